/* Models that have nothing to do with grids; one of them is chosen by MODEL_…. */
#define DIVERGED 1e300
#if defined MODEL_DAHLQUIST /* ẋ = −k·x, Euler with the communication step */
enum { X, GAIN, SIZE };
enum { MEMORY = 2 };
#define IS_OUTPUT(r) ((r) == X)
static const double START[SIZE] = {1, 1};
static void initialise(double *z, double *m) { m[0] = z[X]; }
static void advance(double *z, double *m, double *hidden, double time, double step) { m[0] += step * -z[GAIN] * m[0]; }
static void outputs(double *z, double *m, const double *hidden) { z[X] = m[0]; }

#elif defined MODEL_VAN_DER_POL /* ẍ = μ(1 − x²)ẋ − x, with an internal step that is carried over */
enum { X, V, GAIN, SIZE };
enum { MEMORY = 3 };
#define IS_OUTPUT(r) ((r) <= V)
static const double START[SIZE] = {2, 0, 1};
static void initialise(double *z, double *m) { m[0] = z[X], m[1] = z[V], m[2] = 0; }
static void advance(double *z, double *m, double *hidden, double time, double step) {
    for (m[2] += step; m[2] > 1e-2 * (1 - 1e-6); m[2] -= 1e-2) {
        const double x = m[0], v = m[1];
        m[0] += 1e-2 * v, m[1] += 1e-2 * (z[GAIN] * (1 - x * x) * v - x);
    }
}
static void outputs(double *z, double *m, const double *hidden) { z[X] = m[0], z[V] = m[1]; }

#elif defined MODEL_BOUNCING_BALL /* events inside of a step */
enum { X, V, GAIN, SIZE };
enum { MEMORY = 4 };
#define IS_OUTPUT(r) ((r) <= V)
static const double START[SIZE] = {1, 0, 0.7};
static void initialise(double *z, double *m) { m[0] = z[X], m[1] = z[V], m[2] = 0, m[3] = 0; }
static void advance(double *z, double *m, double *hidden, double time, double step) {
    for (m[2] += step; m[2] > 1e-3 * (1 - 1e-6); m[2] -= 1e-3) {
        if (m[3]) break;
        m[0] += 1e-3 * m[1], m[1] -= 1e-3 * 9.81;
        if (m[0] <= 0 && m[1] < 0) {
            m[0] = 0, m[1] *= -z[GAIN];
            if (m[1] < 0.1) m[3] = 1, m[1] = 0;
        }
    }
    if (m[3]) m[2] = 0;
}
static void outputs(double *z, double *m, const double *hidden) { z[X] = m[0], z[V] = m[1]; }

#elif defined MODEL_GAIN /* y = k·u at once */
enum { U, Y, GAIN, SIZE };
enum { MEMORY = 1 };
#define IS_OUTPUT(r) ((r) == Y)
static const double START[SIZE] = {0, 0, 2};
static void initialise(double *z, double *m) {}
static void advance(double *z, double *m, double *hidden, double time, double step) {}
static void outputs(double *z, double *m, const double *hidden) { z[Y] = z[GAIN] * z[U]; }

#elif defined MODEL_LAG /* T·ẋ = u − x, exactly; y = x + d·u */
enum { U, Y, GAIN, T, SIZE };
enum { MEMORY = 1 };
#define IS_OUTPUT(r) ((r) == Y)
static const double START[SIZE] = {0, 0, 0.5, 0.05};
static void initialise(double *z, double *m) { m[0] = 0; }
static void advance(double *z, double *m, double *hidden, double time, double step) {
    m[0] += (z[U] - m[0]) * -expm1(-step / z[T]);
}
static void outputs(double *z, double *m, const double *hidden) { z[Y] = m[0] + z[GAIN] * z[U]; }

#elif defined MODEL_OPEN_LAG /* the lag with its states as variables: x, and what it was a second ago, which nothing needs */
enum { U, Y, GAIN, T, X, DX, TRAIL, DTRAIL, SIZE };
enum { MEMORY = 1 };
#define IS_OUTPUT(r) ((r) == Y)
static const double START[SIZE] = {0, 0, 0.5, 0.05};
static void initialise(double *z, double *m) { z[X] = z[TRAIL] = 0; }
static void advance(double *z, double *m, double *hidden, double time, double step) {
    z[TRAIL] += (z[X] - z[TRAIL]) * -expm1(-step);
    z[X] += (z[U] - z[X]) * -expm1(-step / z[T]);
}
static void outputs(double *z, double *m, const double *hidden) {
    z[Y] = z[X] + z[GAIN] * z[U], z[DX] = (z[U] - z[X]) / z[T], z[DTRAIL] = z[X] - z[TRAIL];
}

#elif defined MODEL_TANK /* ẋ = r·q − x; a relay r that is looked at once a communication step keeps x in its band */
enum { X, R, GAIN, STEPS, SIZE };
enum { MEMORY = 4 };
#define IS_OUTPUT(r) ((r) == X || (r) == R || (r) == STEPS)
static const double START[SIZE] = {0.5, 1, 1, 0};
static void initialise(double *z, double *m) { m[0] = 0.5, m[1] = 1, m[2] = 0; }
static void advance(double *z, double *m, double *hidden, double time, double step) {
    m[0] += (m[1] * z[GAIN] - m[0]) * -expm1(-step);
    ++m[2];
#ifdef FAULT_RELAY_BY_CALLS
    m[1] = (int)(m[2] / 16) % 2 == 0;
#else
    if (m[0] > 0.54) m[1] = 0;
    if (m[0] < 0.46) m[1] = 1;
#endif
}
static void outputs(double *z, double *m, const double *hidden) {
    z[X] = m[0], z[R] = m[1];
#ifdef FAULT_COUNTS_CALLS
    z[STEPS] = m[2];
#endif
}
#endif
