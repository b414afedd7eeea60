/* Converters of other kinds than converter.c has: matching control with a DC link, a virtual synchronous machine, a
   dispatchable virtual oscillator, a droop, and a grid-following one with a phase-locked loop. A loop for the voltage
   behind a virtual impedance gives the current's reference, a limit cuts it, and the current follows with a lag.
   z: parameters, inputs, outputs, as in converter.c; memory: the states. */
enum { S_N, P_0, Q_0, V_0, THETA_0, GAIN, TAU, IN_1, IN_2, IN_3, OUT_1, OUT_2, OUT_3, OMEGA, SHOWN, SIZE };
enum { I_D, I_Q, DELTA, W, SOURCE, P_F, Q_F, E, X_D, X_Q, Q_SUM, V_F, STATES, P_REF = STATES, Q_REF, E_0, V_REF, ON, NOW, MEMORY };
enum { MATCHING, MACHINE, OSCILLATOR, DROOPING, FOLLOWING };
#define IS_OUTPUT(r) ((r) >= OUT_1 && (r) <= SHOWN)
#define SWITCH ON
#define DIVERGED 1e12

#ifndef RATING
#define RATING 1500.0
#endif
#ifndef KIND
#define KIND DROOPING
#endif
#ifndef DROOP
#define DROOP 0.02 /* frequency's deviation for 1 pu of active power [pu] */
#endif
#ifndef R_V
#define R_V 0.1 /* virtual impedance, with the filter's [pu] */
#endif
#ifndef X_V
#define X_V 0.3
#endif
#ifndef I_LIMIT
#define I_LIMIT 1.2 /* current [pu] */
#endif
#ifndef Q_DROOP
#define Q_DROOP 0.05
#endif
#ifndef T_DC
#define T_DC 0.15 /* energy of the DC link at rated voltage, twice, over the rating [s] */
#endif
#ifndef K_DC
#define K_DC 10.0 /* power of the source for 1 pu of the DC link's voltage [pu] */
#endif
#ifndef T_SOURCE
#define T_SOURCE 0.02 /* lag of the source behind the DC link [s] */
#endif
#ifndef INERTIA
#define INERTIA 4.0 /* of the virtual machine [s] */
#endif
#ifndef T_CURRENT
#define T_CURRENT 3e-3 /* lag of the current behind its reference [s] */
#endif
#ifndef INTERNAL
#define INTERNAL 1e-4
#endif
#define OMEGA_B (2 * 3.14159265358979323846 * 50.0)
#ifndef V_UNIT
#define V_UNIT 1.0
#endif
#ifndef I_UNIT
#define I_UNIT (z[S_N] / 100.0)
#endif
#ifndef P_UNIT
#define P_UNIT 1.0
#endif

static const double START[SIZE] = {RATING, 0.5 * P_UNIT, 0, V_UNIT, 0, DROOP, 0.1, V_UNIT, 0, 0};

typedef struct { double re, im; } phasor;

/* As hypot(), in a tenth of its time: no voltage or current is so large or small that its square has no number. */
static double magnitude(double re, double im) { return sqrt(re * re + im * im); }

static phasor times(phasor a, phasor b) { return (phasor){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
static phasor over(phasor a, phasor b) {
    const double s = b.re * b.re + b.im * b.im;
    return (phasor){(a.re * b.re + a.im * b.im) / s, (a.im * b.re - a.re * b.im) / s};
}
static phasor turned(phasor a, double angle) { return times(a, (phasor){cos(angle), sin(angle)}); }
static double within(double x, double most) { return fmax(-most, fmin(most, x)); }

static phasor voltage(const double *z) {
#if defined PORT_QD
    return (phasor){z[IN_1] / V_UNIT, -z[IN_2] / V_UNIT};
#else
    return (phasor){z[IN_1] / V_UNIT, z[IN_2] / V_UNIT};
#endif
}

/* The size that a current's reference keeps under its limit. */
static double limited(double size) {
#ifdef SOFT_LIMIT /* from this current on it bends towards the limit */
    const double room = I_LIMIT - SOFT_LIMIT;
    return size < SOFT_LIMIT ? size : SOFT_LIMIT + room * -expm1(-(size - SOFT_LIMIT) / room);
#else
    return fmin(size, I_LIMIT);
#endif
}

static void initialise(double *z, double *m) {
    const double v = z[V_0] / V_UNIT, p = z[P_0] / P_UNIT, q = z[Q_0] / P_UNIT;
    const phasor bus = turned((phasor){v, 0}, z[THETA_0]);
    const phasor i = over((phasor){p, -q}, (phasor){bus.re, -bus.im});
    const phasor fall = times(i, (phasor){R_V, X_V}), e = {bus.re + fall.re, bus.im + fall.im};
    m[DELTA] = KIND == FOLLOWING ? z[THETA_0] : atan2(e.im, e.re);
    const phasor own = turned(i, -m[DELTA]);
    m[I_D] = m[X_D] = own.re, m[I_Q] = m[X_Q] = own.im;
    m[E] = m[E_0] = magnitude(e.re, e.im);
    m[W] = 0, m[Q_SUM] = 0, m[V_F] = m[V_REF] = v, m[NOW] = 0;
    m[P_F] = m[P_REF] = p, m[SOURCE] = KIND == FOLLOWING ? 0 : p, m[Q_F] = m[Q_REF] = q;
}

/* Deviation of its frequency [pu]. */
static double slip(const double *z, const double *m, phasor v) {
    if (KIND == MATCHING) return z[GAIN] * K_DC * m[W];
    if (KIND == DROOPING) {
        double w = z[GAIN] * (m[P_REF] - m[P_F]);
#ifdef FAULT_SLIP_WITHIN /* its frequency never deviates by more [pu] */
        w = within(w, FAULT_SLIP_WITHIN);
#endif
#ifdef FAULT_SLIP_UPWARDS /* a factor of what turns it faster */
        if (w > 0) w *= FAULT_SLIP_UPWARDS;
#endif
        return w;
    }
    if (KIND == FOLLOWING) return m[W] + 0.12 * turned(v, -m[DELTA]).im;
    if (KIND == OSCILLATOR) return z[GAIN] * (m[P_REF] / (m[E_0] * m[E_0]) - m[P_F] / (m[E] * m[E]));
    return m[W];
}

static void rates(const double *z, const double *m, phasor v, double *d) {
    const double size_v = magnitude(v.re, v.im);
    const phasor own = turned(v, -m[DELTA]), i = {m[I_D], m[I_Q]};
    const double p = own.re * i.re + own.im * i.im, q = own.im * i.re - own.re * i.im;
    double e = KIND == OSCILLATOR ? m[E] : m[E_0] + Q_DROOP * (m[Q_REF] - m[Q_F]);
    phasor wanted, error = {0, 0};
    d[DELTA] = OMEGA_B * slip(z, m, v);
    d[P_F] = (p - m[P_F]) / (KIND == OSCILLATOR ? 5e-3 : z[TAU]);
    d[Q_F] = (q - m[Q_F]) / (KIND == OSCILLATOR ? 5e-3 : z[TAU]);
    d[W] = d[SOURCE] = d[E] = d[X_D] = d[X_Q] = d[Q_SUM] = 0;
    d[V_F] = (size_v - m[V_F]) / 0.02;
    if (KIND == MATCHING) {
        const double chopper = m[W] > 0.1 ? 40 * (m[W] - 0.1) : 0;
        d[SOURCE] = (within(m[P_REF] - K_DC * m[W], 1.1) - m[SOURCE]) / T_SOURCE;
        d[W] = (m[SOURCE] - p - chopper) / T_DC;
    }
    if (KIND == MACHINE) d[W] = (m[P_REF] - p - m[W] / z[GAIN]) / (2 * INERTIA);
    if (KIND == OSCILLATOR) {
        d[E] = OMEGA_B * DROOP * (m[Q_REF] / (m[E_0] * m[E_0]) - m[Q_F] / (m[E] * m[E])) * m[E];
        d[E] += 30 * (1 - m[E] * m[E] / (m[E_0] * m[E_0])) * m[E];
    }
    if (KIND == FOLLOWING) {
        d[W] = size_v < 0.3 ? 0 : 2.0 * own.im; /* it waits where there is nothing to follow */
        /* fast frequency: power by the filtered frequency; reactive power by the voltage, with an integral part */
        double more = -m[SOURCE] / z[GAIN];
#ifdef FAST_WITHIN /* the most that its fast frequency response gives [pu] */
        more = within(more, FAST_WITHIN);
#endif
        const double power = m[P_REF] + more;
        const double q_wanted = m[Q_REF] + 2 * (m[V_REF] - m[V_F]) + m[Q_SUM];
        d[SOURCE] = (m[W] - m[SOURCE]) / z[TAU]; /* here: the frequency's deviation, filtered */
        wanted = over((phasor){power, -q_wanted}, (phasor){fmax(m[V_F], 0.3), 0});
    } else {
        const phasor free = over((phasor){e - own.re, -own.im}, (phasor){R_V, X_V});
        wanted = free;
#ifdef VOLTAGE_LOOP /* gain of its integral part [1/s] */
        error = (phasor){free.re - i.re, free.im - i.im};
        wanted = (phasor){0.5 * error.re + m[X_D], 0.5 * error.im + m[X_Q]};
#endif
    }
    const double size = magnitude(wanted.re, wanted.im), part = size > 1e-9 ? limited(size) / size : 1;
    const phasor given = {part * wanted.re, part * wanted.im};
#ifdef VOLTAGE_LOOP
    double back = 2 * VOLTAGE_LOOP; /* of the anti-windup [1/s] */
#ifdef FAULT_ANTI_WINDUP /* part of it that is left; own: the voltage */
    back *= FAULT_ANTI_WINDUP;
#endif
    d[X_D] = VOLTAGE_LOOP * error.re + back * (given.re - wanted.re);
    d[X_Q] = VOLTAGE_LOOP * error.im + back * (given.im - wanted.im);
#endif
#ifdef FAULT_Q_WINDS_UP /* its integral part of the reactive power goes on at the limit [1/s] */
    d[Q_SUM] = FAULT_Q_WINDS_UP * (m[V_REF] - m[V_F]) * (fabs(m[V_REF] - m[V_F]) > 0.1) - m[Q_SUM] / 5.0;
#endif
    d[I_D] = (given.re - m[I_D]) / T_CURRENT;
    d[I_Q] = (given.im - m[I_Q]) / T_CURRENT;
}

static void substep(const double *z, double *m, phasor v, double h) {
    double k[4][STATES], x[MEMORY];
    memcpy(x, m, sizeof x);
    for (int s = 0; s < 4; ++s) {
        if (s)
            for (int j = 0; j < STATES; ++j) x[j] = m[j] + (s == 3 ? h : h / 2) * k[s - 1][j];
        rates(z, x, v, k[s]);
    }
    for (int j = 0; j < STATES; ++j) m[j] += h / 6 * (k[0][j] + 2 * k[1][j] + 2 * k[2][j] + k[3][j]);
}

static void advance(double *z, double *m, double *hidden, double time, double step) {
    const int parts = (int)ceil(step / INTERNAL - 1e-9);
    const phasor v = voltage(z);
    for (int k = 0; k < parts; ++k) substep(z, m, v, step / parts);
}

static void outputs(double *z, double *m, const double *hidden) {
    const phasor i = turned((phasor){m[I_D], m[I_Q]}, m[DELTA]);
#if defined PORT_QD
    z[OUT_1] = i.re * I_UNIT, z[OUT_2] = -i.im * I_UNIT;
#else
    z[OUT_1] = i.re * I_UNIT, z[OUT_2] = i.im * I_UNIT;
#endif
    z[OMEGA] = 1 + (KIND == FOLLOWING ? m[W] : slip(z, m, voltage(z)));
}
