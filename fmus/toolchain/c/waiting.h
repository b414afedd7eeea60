/* Waiting for a word of memory that another thread or process writes: awake for a moment, then in the kernel, which
   looks again by itself from time to time. */
#ifdef _WIN32
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
