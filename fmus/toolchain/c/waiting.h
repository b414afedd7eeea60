/* Waiting for a word of memory that another thread or process writes: awake for a moment, then in the kernel, which
   looks again by itself from time to time. */
#ifdef UNDER_WINE
/* The other process is one of Linux. A program under Wine runs on Linux's kernel and can ask it itself; from version 10
   on Wine may take such a question for one to itself. */
static int64_t of_linux(int64_t number, int64_t a, int64_t b, int64_t c, int64_t d) {
    register int64_t r10 __asm__("r10") = d;
    int64_t found;
    __asm__ volatile("syscall" : "=a"(found) : "a"(number), "D"(a), "S"(b), "d"(c), "r"(r10) : "rcx", "r11", "memory");
    return found;
}
static int older_wine(void) {
    static int known = -1;
    if (known < 0) {
        const char *(*version)(void) = (void *)GetProcAddress(GetModuleHandleA("ntdll.dll"), "wine_get_version");
        known = version && atoi(version()) < 10;
    }
    return known;
}
enum { LINUX_FUTEX = 202, LINUX_GETPPID = 110, LINUX_WAIT = 0, LINUX_WAKE = 1 };
static void rest(volatile int32_t *word, int32_t value) {
    const int64_t most[2] = {0, 20000000};
    if (older_wine()) of_linux(LINUX_FUTEX, (intptr_t)word, LINUX_WAIT, value, (intptr_t)most);
    else Sleep(*word == value ? 1 : 0);
}
static void wake(volatile int32_t *word) {
    if (older_wine()) of_linux(LINUX_FUTEX, (intptr_t)word, LINUX_WAKE, INT32_MAX, 0);
}
#elif defined _WIN32
static void rest(volatile int32_t *word, int32_t value) { Sleep(*word == value ? 1 : 0); }
static void wake(volatile int32_t *word) {}
#elif defined __linux__
#include <limits.h>
#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>
static void rest(volatile int32_t *word, int32_t value) {
    const struct timespec most = {0, 20000000};
    syscall(SYS_futex, word, FUTEX_WAIT, value, &most, NULL, 0);
}
static void wake(volatile int32_t *word) { syscall(SYS_futex, word, FUTEX_WAKE, INT_MAX, NULL, NULL, 0); }
#else
static void rest(volatile int32_t *word, int32_t value) {
    const struct timespec most = {0, 50000};
    nanosleep(&most, NULL);
}
static void wake(volatile int32_t *word) {}
#endif

static void relax(void) {
#if defined __x86_64__ || defined _M_X64
    __asm__ __volatile__("pause");
#elif defined __aarch64__
    __asm__ __volatile__("yield");
#endif
}
