/* Machine code that goes before fmi2Instantiate of pythonfmu's Linux binary, which undoes "%20" of the resources' URI
   alone and reads through a null pointer where no such folder is: "ü", "(" or "#" in a path ended the process.
   It calls nothing but that function and the logger, so that its bytes run wherever they lie (`wrapper.py` has them):

   gcc -Os -fPIC -fcf-protection=none -fno-stack-protector -fno-asynchronous-unwind-tables -ffreestanding -nostdlib \
       -shared -Wl,-T,layout.ld -o code.so resources_path.c && objcopy -O binary -j .text code.so code.bin

   with layout.ld: SECTIONS { .text : { *(.text.a) *(.text) *(.text.*) *(.rodata*) *(.last) } /DISCARD/ : { *(*) } } */
enum { FILE_TO_OPEN = 16, LONGEST = 4096, NOT_THERE = 3 };

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *allocate, *release, *finished, *environment;
} callbacks_t;
typedef void *instantiate_t(const char *, int, const char *, const char *, const callbacks_t *, int, int);

/* The last four bytes: how far from them the function lies; `wrapper.py` fills them in. */
__asm__(".section .last,\"a\"\n.globl distance\n.hidden distance\ndistance: .long 0x7fffffff\n.text");
extern const int distance;

static int digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    c |= 32;
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

static int begins(const char *text, const char *with) {
    while (*with)
        if (*text++ != *with++) return 0;
    return 1;
}

static long readable(const char *path) { /* access(path, R_OK) */
    long found;
    __asm__ volatile("syscall" : "=a"(found) : "a"(21), "D"(path), "S"(4) : "rcx", "r11", "memory");
    return !found;
}

__attribute__((section(".text.a"))) void *instantiate(const char *name, int type, const char *guid, const char *uri,
                                                      const callbacks_t *callbacks, int visible, int logging) {
    char path[LONGEST];
    const char *from = uri ? uri : "";
    int n = 0, escaped = begins(from, "file:");
    if (escaped) from += 5;
    if (escaped && begins(from, "//"))
        for (from += 2; *from && *from != '/';) ++from; /* the host, which is this one */
    for (; *from && n < LONGEST - FILE_TO_OPEN - 1; ++from) {
        int high = escaped && *from == '%' ? digit(from[1]) : -1, low = high < 0 ? -1 : digit(from[2]);
        path[n++] = (char)(low < 0 ? *from : 16 * high + low);
        if (low >= 0) from += 2;
    }
    int end = n;
    for (const char *file = "/slavemodule.txt"; *file;) path[n++] = *file++;
    path[n] = 0;
    if (*from || !readable(path)) {
        if (callbacks && callbacks->logger)
            callbacks->logger(callbacks->environment, name, NOT_THERE, "logStatusError",
                              "the FMU's resources cannot be read: there is no file %s", path);
        return 0;
    }
    path[end] = 0;
    return ((instantiate_t *)((const char *)&distance + distance))(name, type, guid, path, callbacks, visible, logging);
}
