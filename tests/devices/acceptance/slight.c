/* A lag whose defects are as slight as LEAK (what a saved state forgets) and NOISE (what no two runs share). */
#define DIVERGED 1e300
enum { U, Y, GAIN, SIZE };
enum { MEMORY = 1 };
#define IS_OUTPUT(r) ((r) == Y)
#ifndef LEAK
#define LEAK 0.0
#endif
#ifndef NOISE
#define NOISE 0.0
#endif
static const double START[SIZE] = {0, 0, 1};
static void initialise(double *z, double *m) { m[0] = 0; }
static void advance(double *z, double *m, double *hidden, double time, double step) {
    const double kept = exp(-step / 0.02);
    m[0] = kept * m[0] + (1 - kept) * z[U] * (1 + NOISE * ((double)rand() / RAND_MAX - 0.5));
    hidden[0] = kept * hidden[0] + (1 - kept) * z[U];
}
static void outputs(double *z, double *m, const double *hidden) { z[Y] = m[0] + LEAK * hidden[0]; }
