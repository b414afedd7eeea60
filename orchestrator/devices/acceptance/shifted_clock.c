/* Loaded before the C library, it shows a process another date and time of day. What measures durations stays.
   By how much they are shifted, it reads when it is loaded, and when a process that has it is told to read it again.
   Linux alone loads it; for other systems the library is empty, so that a wheel is built in one way. */
#ifdef __linux__
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define EXPORT __attribute__((visibility("default")))
#ifndef TIME_UTC
#define TIME_UTC 1
#endif

static long shift; /* [s] */

__attribute__((constructor)) EXPORT void gfor_read_clock_shift(void) {
    const char *text = getenv("GFOR_COSIM_CLOCK_SHIFT");
    if (text) shift = atol(text);
}

EXPORT int clock_gettime(clockid_t clock, struct timespec *now) {
    const int status = (int)syscall(SYS_clock_gettime, clock, now);
    if (status == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) now->tv_sec += shift;
    return status;
}

EXPORT time_t time(time_t *seconds) {
    struct timespec now = {0, 0};
    clock_gettime(CLOCK_REALTIME, &now);
    if (seconds) *seconds = now.tv_sec;
    return now.tv_sec;
}

EXPORT int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    struct timespec exact = {0, 0};
    (void)zone;
    const int status = clock_gettime(CLOCK_REALTIME, &exact);
    if (now) now->tv_sec = exact.tv_sec, now->tv_usec = exact.tv_nsec / 1000;
    return status;
}

EXPORT int timespec_get(struct timespec *now, int base) {
    if (base != TIME_UTC) return 0;
    return clock_gettime(CLOCK_REALTIME, now) == 0 ? base : 0;
}
#else
typedef int nothing_to_load; /* C wants a declaration */
#endif
