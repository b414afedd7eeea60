/* Repeats what it was told: the time at which its last step began, the step's size, and its input then. */
#define DIVERGED 1e300
enum { U, TIME, STEP, HELD, GAIN, SIZE };
enum { MEMORY = 3 };
#define IS_OUTPUT(r) ((r) >= TIME && (r) <= HELD)
static const double START[SIZE] = {0};
static void initialise(double *z, double *m) { m[0] = -1, m[1] = 0, m[2] = z[U]; }
static void advance(double *z, double *m, double *hidden, double time, double step) {
    m[0] = time, m[1] = step, m[2] = z[U];
}
static void outputs(double *z, double *m, const double *hidden) { z[TIME] = m[0], z[STEP] = m[1], z[HELD] = m[2]; }
