/* The vendor's library: a private copy for each instance, as many DLLs keep variables of their own. */
#ifdef _WIN32
/* Names that are ours, which Windows has as well. */
#define WIN32_LEAN_AND_MEAN
#define NOGDI
#define NOUSER
#define GUID WINDOWS_GUID
#define BOOLEAN WINDOWS_BOOLEAN
#define SIZE WINDOWS_SIZE
#include <windows.h>
#undef GUID
#undef BOOLEAN
#undef SIZE
#define CALLED __cdecl
typedef struct {
    HMODULE handle;
} library;
#else
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>
#define CALLED
typedef struct {
    void *handle;
    int file; /* stays open: the loader knows a library by its name, which is the file's number */
} library;
#endif

enum { LONGEST_PATH = 4096 };

#ifdef _WIN32

/* Folder of the FMU's resources, found from where this code was loaded: binaries/win64/NAME.dll. */
static int resources(char *path) {
    HMODULE own;
    if (!GetModuleHandleExA(6, (const char *)&resources, &own)) return 0;
    const DWORD length = GetModuleFileNameA(own, path, LONGEST_PATH);
    return length && length < LONGEST_PATH;
}

static int open_copy(library *l, const char *path, char *why, size_t room) {
    char folder[LONGEST_PATH], copy[LONGEST_PATH];
    if (!GetTempPathA(sizeof folder, folder) || !GetTempFileNameA(folder, "dll", 0, copy) || !CopyFileA(path, copy, 0)) {
        snprintf(why, room, "no private copy of %.1000s can be made (Windows error %lu)", path, GetLastError());
        return 0;
    }
    l->handle = LoadLibraryA(copy);
    if (!l->handle) snprintf(why, room, "%.1000s cannot be loaded (Windows error %lu)", path, GetLastError());
    MoveFileExA(copy, NULL, 4); /* removed at the next start, as a loaded library cannot be */
    return l->handle != NULL;
}

static void *function(const library *l, const char *name) { return (void *)GetProcAddress(l->handle, name); }
static void close_copy(library *l) { FreeLibrary(l->handle); }
static char *loaded_at(const library *l) { return (char *)l->handle; }

#else

static int resources(char *path) {
    Dl_info own;
    if (!dladdr((void *)&resources, &own) || !own.dli_fname) return 0;
    return snprintf(path, LONGEST_PATH, "%s", own.dli_fname) < LONGEST_PATH;
}

static int copied(const char *path, int to) {
    char bytes[65536];
    const int from = open(path, O_RDONLY);
    if (from < 0) return 0;
    ssize_t n;
    while ((n = read(from, bytes, sizeof bytes)) > 0)
        for (ssize_t done = 0, more; done < n; done += more)
            if ((more = write(to, bytes + done, (size_t)(n - done))) <= 0) {
                close(from);
                return 0;
            }
    close(from);
    return n == 0;
}

/* A file of its own in memory, or on the disk where the system has no such files. */
static int open_copy(library *l, const char *path, char *why, size_t room) {
    const char *folder = getenv("TMPDIR");
    char copy[LONGEST_PATH];
    int on_disk = 0;
    l->file = (int)syscall(SYS_memfd_create, "vendor_dll", 1u);
    if (l->file >= 0)
        snprintf(copy, sizeof copy, "/proc/self/fd/%d", l->file);
    else {
        snprintf(copy, sizeof copy, "%.3000s/dll_XXXXXX", folder && *folder ? folder : "/tmp");
        l->file = mkstemp(copy);
        on_disk = l->file >= 0;
    }
    const int whole = l->file >= 0 && copied(path, l->file);
    if (!whole) snprintf(why, room, "no private copy of %.1000s can be made, in memory or in a temporary folder", path);
    l->handle = whole ? dlopen(copy, RTLD_NOW | RTLD_LOCAL) : NULL;
    if (whole && !l->handle) snprintf(why, room, "%.1000s", dlerror());
    if (on_disk) unlink(copy);
    if (!l->handle && l->file >= 0) close(l->file);
    return l->handle != NULL;
}

static void *function(const library *l, const char *name) { return dlsym(l->handle, name); }

static void close_copy(library *l) {
    dlclose(l->handle);
    close(l->file);
}

/* Where places in the library's memory are counted from. */
static char *loaded_at(const library *l) {
    Dl_info found;
    void *known = function(l, "Model_GetInfo");
    return known && dladdr(known, &found) ? (char *)found.dli_fbase : NULL;
}

#endif

/* A file in the FMU: ../../resources/NAME beside binaries/PLATFORM/HOST. */
static int in_resources(char path[LONGEST_PATH + 300], const char *name) {
    if (!resources(path)) return 0;
    for (int up = 0; up < 3; ++up) {
        char *slash = strrchr(path, '/'), *other = strrchr(path, '\\');
        char *end = slash > other ? slash : other;
        if (end) *end = 0;
    }
    const size_t length = strlen(path);
    return snprintf(path + length, LONGEST_PATH + 300 - length, "/resources/%s", name) > 0;
}

static int open_vendor(library *l, char *why, size_t room) {
    char path[LONGEST_PATH + 300];
    if (in_resources(path, VENDOR_FILE)) return open_copy(l, path, why, room);
    snprintf(why, room, "this FMU does not find its own folder");
    return 0;
}

/* Value of a text parameter; of a file that the FMU brings, where that lies. */
static const char *word(int i) {
    static char path[TEXTS + 1][LONGEST_PATH + 300];
    if (!CARRIED[i]) return WORDS[i];
    return *path[i] || in_resources(path[i], WORDS[i]) ? path[i] : WORDS[i];
}

/* Where a DLL fails at its start: the first text parameter that names, as it seems, a file which cannot be read. */
static int unread(void) {
    for (int i = 0; i < TEXTS; ++i) {
        const char *text = word(i), *dot = strrchr(text, '.');
        const int letter = dot && dot > text ? (dot[1] | 32) : 0;
        const int named = strpbrk(text, "/\\") || (letter >= 'a' && letter <= 'z' && strlen(dot) < 7);
        FILE *file = named ? fopen(text, "rb") : NULL;
        if (file) fclose(file);
        if (named && !file) return i;
    }
    return -1;
}
