/* Says on which thread it made its last step, which takes a while, and adds up numbers that have to be rounded. */
#include <stdint.h>
#define DIVERGED 1e300
enum { U, THREAD, SUM, SIZE };
enum { MEMORY = 2 };
#define IS_OUTPUT(r) ((r) >= THREAD && (r) <= SUM)
static const double START[SIZE] = {0};
static _Thread_local char here;
static void initialise(double *z, double *m) { m[0] = 0, m[1] = 0; }
static void advance(double *z, double *m, double *hidden, double time, double step) {
    volatile double part = 0.1;
    for (int k = 0; k < 20000; ++k) m[1] += part / (k + 1) * (1 + z[U]);
    m[0] = (double)(uintptr_t)&here;
}
static void outputs(double *z, double *m, const double *hidden) { z[THREAD] = m[0], z[SUM] = m[1]; }
