/* y = x + v + 0.1·h: x of a controller, v of a filter, both following u, and with HIDDEN an h that nothing declares.
   With SAMPLED the controller acts every 20 ms and stands still in between.
   With BAND x grows at 35 1/s beyond it, up to a limit of 200; with LIMIT x stays within it.
   With CURVED v follows nothing but CURVED·x³, and y = x.
   With RUNAWAY x grows at 40 1/s up to a limit of 200. */
enum { U, Y, X, V, RATE_X, RATE_V, SIZE };
enum { H, SINCE, MEMORY };
#define IS_OUTPUT(r) ((r) == Y)
#define DIVERGED 1e12
#define T_X 0.2
#define T_V 0.05
static const double START[SIZE] = {0};
static void initialise(double *z, double *m) {}
static void advance(double *z, double *m, double *hidden, double time, double step) {
#ifdef HIDDEN
    m[H] += step * (0.5 * m[H] + z[X]);
#endif
#ifdef SAMPLED
    m[SINCE] += step;
    if (m[SINCE] > 0.02 * (1 - 1e-6)) m[SINCE] = 0, z[X] += 0.5 * (z[U] - z[X]);
#elif defined RUNAWAY
    z[X] = fmax(-200, fmin(200, z[X] + step * (40 * z[X] + z[U])));
#else
    z[X] += -expm1(-step / T_X) * (z[U] - z[X]);
#endif
#ifdef BAND
    z[X] += step * 40 * copysign(fmax(0, fmin(200, fabs(z[X])) - BAND), z[X]);
    z[X] = fmax(-200, fmin(200, z[X]));
#endif
#ifdef LIMIT
    z[X] = fmax(-LIMIT, fmin(LIMIT, z[X]));
#endif
#ifdef CURVED
    z[V] += -expm1(-step / T_V) * (CURVED * z[X] * z[X] * z[X] - z[V]);
#else
    z[V] += -expm1(-step / T_V) * (z[U] - z[V]);
#endif
}
static void outputs(double *z, double *m, const double *hidden) {
#ifdef CURVED
    z[Y] = z[X];
    z[RATE_V] = (CURVED * z[X] * z[X] * z[X] - z[V]) / T_V;
#else
    z[Y] = z[X] + z[V] + 0.1 * m[H];
    z[RATE_V] = (z[U] - z[V]) / T_V;
#endif
#ifdef RATE_OF_NOTHING
    z[RATE_X] = 0;
#else
    z[RATE_X] = (z[U] - z[X]) / T_X;
#endif
}
