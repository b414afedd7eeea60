/* Devices with three phases: a voltage E of the power flow's behind R + jX, an estimate of both sequences of the bus
   voltage, a part of the negative sequence that the voltage follows, and a limit of the current in each phase.
   z: parameters, inputs, outputs, as in converter.c; memory: the states, in the network's frame. */
enum { S_N, P_0, Q_0, V_0, THETA_0, GAIN, TAU, IN_1, IN_2, IN_3, OUT_1, OUT_2, OUT_3, OMEGA, SHOWN, SIZE };
enum { I_RE, I_IM, P_RE, P_IM, N_RE, N_IM, STATES, E_RE = STATES, E_IM, NOW, UNEVEN, TRIPPED, ON, MEMORY };
#define IS_OUTPUT(r) ((r) >= OUT_1 && (r) <= SHOWN)
#define SWITCH ON
#define DIVERGED 1e12

#ifndef RATING
#define RATING 1500.0
#endif
#ifndef R_PU
#define R_PU 0.03
#endif
#ifndef X_PU
#define X_PU 0.25
#endif
#ifndef FOLLOWS
#define FOLLOWS 0.0 /* part of the bus's negative sequence that its own voltage has: 1 keeps the current balanced */
#endif
#ifndef ANGLE
#define ANGLE 0.0 /* by which that part is turned [rad] */
#endif
#ifndef I_LIMIT
#define I_LIMIT 1.2 /* current of each phase [pu] */
#endif
#ifndef SEPARATES
#define SEPARATES 150.0 /* rate at which it tells the sequences apart [1/s] */
#endif
#define OMEGA_B (2 * 3.14159265358979323846 * 50.0)
#define THIRD 2.0943951023931953
#define V_UNIT (230.0 * 0.81649658092772603)
#define I_UNIT (z[S_N] / 230.0 * 0.81649658092772603)

static const double START[SIZE] = {RATING, 0.5 * RATING, 0, V_UNIT, 0, 0.02, 0.1, V_UNIT, -V_UNIT / 2, -V_UNIT / 2};

typedef struct { double re, im; } phasor;

static phasor times(phasor a, phasor b) { return (phasor){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re}; }
static phasor plus(phasor a, phasor b) { return (phasor){a.re + b.re, a.im + b.im}; }
static phasor minus(phasor a, phasor b) { return (phasor){a.re - b.re, a.im - b.im}; }
static phasor turned(phasor a, double angle) { return times(a, (phasor){cos(angle), sin(angle)}); }
static phasor over(phasor a, phasor b) {
    const double s = b.re * b.re + b.im * b.im;
    return (phasor){(a.re * b.re + a.im * b.im) / s, (a.im * b.re - a.re * b.im) / s};
}

#ifdef FAULT_SWAPS_VOLTAGE
enum { V_B = IN_3, V_C = IN_2 };
#else
enum { V_B = IN_2, V_C = IN_3 };
#endif

static phasor voltage(const double *z, double time) {
    const double a = (2 * z[IN_1] - z[V_B] - z[V_C]) / 3, b = (z[V_B] - z[V_C]) / sqrt(3.0);
    return turned((phasor){a / V_UNIT, b / V_UNIT}, -OMEGA_B * time);
}

static void initialise(double *z, double *m) {
    const double v = z[V_0] / V_UNIT;
    const phasor bus = turned((phasor){v, 0}, z[THETA_0]);
    const phasor i = over((phasor){z[P_0] / RATING, -z[Q_0] / RATING}, (phasor){bus.re, -bus.im});
    const phasor e = plus(bus, times(i, (phasor){R_PU, X_PU}));
    m[I_RE] = i.re, m[I_IM] = i.im, m[P_RE] = bus.re, m[P_IM] = bus.im, m[N_RE] = m[N_IM] = 0;
    m[E_RE] = e.re, m[E_IM] = e.im, m[NOW] = m[UNEVEN] = m[TRIPPED] = 0;
}

/* Largest current of a phase that both sequences make; `negative` stands as in the frame, turning backwards. */
static double of_phases(phasor positive, phasor negative, double angle) {
    double most = 0;
    for (int k = 0; k < 3; ++k) {
        const phasor one = turned(positive, -THIRD * k), other = turned((phasor){negative.re, -negative.im}, THIRD * k - 2 * angle);
        most = fmax(most, hypot(one.re + other.re, one.im + other.im));
    }
    return most;
}

static void rates(const double *m, phasor v, double time, double *d) {
    const phasor i = {m[I_RE], m[I_IM]}, p = {m[P_RE], m[P_IM]}, n = {m[N_RE], m[N_IM]}, e = {m[E_RE], m[E_IM]};
    const phasor Z = {R_PU, X_PU}, Z_n = {R_PU, -X_PU}; /* to both sequences, as they turn in the frame */
    const phasor left = minus(minus(v, p), n);
    const phasor follows = times((phasor){FOLLOWS * cos(ANGLE), -FOLLOWS * sin(ANGLE)}, n);
    const phasor wanted = over(minus(e, p), Z), wanted_n = over(minus(follows, n), Z_n);
#ifdef FAULT_LIMITS_MEAN /* of the phases: that of the positive sequence */
    const double size = hypot(wanted.re, wanted.im);
#else
    const double size = of_phases(wanted, wanted_n, OMEGA_B * time);
#endif
    const double part = size > I_LIMIT ? I_LIMIT / size : 1;
#ifdef FAULT_LIMITS_MEAN
    const phasor given_n = wanted_n;
#else
    const phasor given_n = {part * wanted_n.re, part * wanted_n.im};
#endif
    const phasor given = {part * wanted.re, part * wanted.im};
    phasor u = plus(plus(p, times(Z, given)), plus(n, times(Z_n, given_n)));
#ifdef FAULT_SWINGS /* voltage [pu] of an oscillation of 30 Hz that a negative sequence keeps up */
    if (hypot(n.re, n.im) > 0.003) u.re += FAULT_SWINGS * cos(2 * 3.14159265358979323846 * 30 * time);
#endif
    const phasor across = minus(minus(u, v), times(Z, i));
    d[I_RE] = OMEGA_B / X_PU * across.re, d[I_IM] = OMEGA_B / X_PU * across.im;
    d[P_RE] = SEPARATES * left.re, d[P_IM] = SEPARATES * left.im;
    d[N_RE] = SEPARATES * left.re + 2 * OMEGA_B * n.im, d[N_IM] = SEPARATES * left.im - 2 * OMEGA_B * n.re;
#ifdef PASSIVE /* the voltage behind the impedance alone */
    d[I_RE] = OMEGA_B / X_PU * (e.re - v.re - R_PU * i.re + X_PU * i.im);
    d[I_IM] = OMEGA_B / X_PU * (e.im - v.im - R_PU * i.im - X_PU * i.re);
#endif
}

static void substep(double *m, phasor v, double time, double h) {
    double k[4][STATES], x[MEMORY];
    memcpy(x, m, sizeof x);
    for (int s = 0; s < 4; ++s) {
        if (s)
            for (int j = 0; j < STATES; ++j) x[j] = m[j] + (s == 3 ? h : h / 2) * k[s - 1][j];
        rates(x, v, time + (s == 0 ? 0 : s == 3 ? h : h / 2), k[s]);
    }
    for (int j = 0; j < STATES; ++j) m[j] += h / 6 * (k[0][j] + 2 * k[1][j] + 2 * k[2][j] + k[3][j]);
    m[UNEVEN] = hypot(m[N_RE], m[N_IM]) > 0.1 ? m[UNEVEN] + h : 0;
#ifdef FAULT_LOSES_ITS_LOCK /* time [s] of a negative sequence of 0.1 pu after which its phase-locked loop gives up */
    if (m[UNEVEN] > FAULT_LOSES_ITS_LOCK) m[TRIPPED] = 1;
#endif
}

static void advance(double *z, double *m, double *hidden, double time, double step) {
    const phasor v = voltage(z, time + step / 2);
    for (int k = 0; k < 4; ++k) substep(m, v, time + k * step / 4, step / 4);
    m[NOW] = time + step;
}

static void outputs(double *z, double *m, const double *hidden) {
    phasor i = {m[I_RE], m[I_IM]};
    if (m[TRIPPED]) i.re = i.im = 0;
    for (int k = 0; k < 3; ++k) z[OUT_1 + k] = turned(i, OMEGA_B * m[NOW] - THIRD * k).re * I_UNIT;
#ifdef FAULT_SWAPS_CURRENT
    const double b = z[OUT_2];
    z[OUT_2] = z[OUT_3], z[OUT_3] = b;
#endif
    z[OMEGA] = 1;
}
