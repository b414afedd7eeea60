/* A grid-forming converter of few equations: a voltage E∠δ behind R + jX, a droop from active power to frequency, and
   one from reactive power to voltage. Inputs and outputs in the form PORT_…; start values from a power flow.
   z: parameters, inputs, outputs; memory: the states. */
enum { S_N, P_0, Q_0, V_0, THETA_0, GAIN, TAU, IN_1, IN_2, IN_3, OUT_1, OUT_2, OUT_3, OMEGA, SHOWN, POD_K, POD_T_W, POD_T_F, POD_LIMIT, DELTA_P, SIZE };
enum { I_RE, I_IM, DELTA, P_F, Q_F, REST, P_REF, Q_REF, E_0, TICK, PENDING, ON, QUICK, SLOW, TIRED, DIPS, LOW, WOUND, BLOCKED, ANGLE, RING, RINGING,
       LAGGED, TRIPLED, VOLT, P_NOW, SINCE, OVER, WASHED, PASSED, K_AT_START, AGE, WORKED, WAS_ON, SWITCHED, STORED, USED, SUMMED, LAST_SAMPLE, MEMORY };
#define SWITCH ON /* a Boolean: damping by the frequency behind a washout; with POD, a damping controller */
#define IS_OUTPUT(r) (((r) >= OUT_1 && (r) <= SHOWN) || (r) == DELTA_P)
#define DIVERGED 1e12

#ifndef RATING
#define RATING 1500.0
#endif
#ifndef DROOP
#define DROOP 0.02
#endif
#ifndef X_PU
#define X_PU 0.25
#endif
#ifndef R_PU
#define R_PU 0.03
#endif
#ifndef SHUNT
#define SHUNT 0.0 /* conductance at the port: direct feed-through */
#endif
#ifndef INTERNAL
#define INTERNAL 1e-4
#endif
#ifndef V_UNIT
#define V_UNIT 1.0 /* FMU's units in 1 pu of voltage, of current on the rating, of power */
#endif
#ifndef I_UNIT
#define I_UNIT (z[S_N] / 100.0)
#endif
#ifndef P_UNIT
#define P_UNIT 1.0
#endif
#ifndef I_FACTOR
#define I_FACTOR 1.0 /* a wrong base or sign */
#endif
#ifndef Q_FACTOR
#define Q_FACTOR 1.0
#endif
#ifndef I_LIMIT
#define I_LIMIT 1.5 /* current [pu] */
#endif
#ifndef P_MEASURED
#define P_MEASURED 1.0 /* signs of what its droops measure */
#endif
#ifndef Q_MEASURED
#define Q_MEASURED 1.0
#endif
#ifndef Q_DROOP
#define Q_DROOP 0.05
#endif
#ifndef NOMINAL
#define NOMINAL 50.0 /* Hz */
#endif
#ifndef OMEGA_UNIT
#define OMEGA_UNIT 1.0
#endif
#ifndef OMEGA_FACTOR
#define OMEGA_FACTOR 1.0 /* of the deviation that it shows */
#endif
#ifndef POD_UNIT
#define POD_UNIT 1.0 /* FMU's units in 1 pu of its damping controller's output and of the limit */
#endif
#ifndef POD_SHOWN
#define POD_SHOWN POD_UNIT
#endif
#ifdef POD_SAMPLES /* time [s] between two samples of its input */
#define POD_PASSED m[LAST_SAMPLE]
#else
#define POD_PASSED m[PASSED]
#endif
#ifndef POD_SLOWER
#define POD_SLOWER 1.0 /* its washout's time constant in parts of the declared one */
#endif
#ifndef POD_WASHES
#define POD_WASHES 1.0 /* part of a lasting deviation that its washout takes out */
#endif
#ifndef POD_MOST
#define POD_MOST 0.1 /* the limit as declared, in that unit */
#endif
#define OMEGA_B (2 * 3.14159265358979323846 * NOMINAL)

#ifndef TURNS
#define TURNS OMEGA_B /* rad/s by which its angle turns with 1 pu of frequency */
#endif

static const double START[SIZE] = {RATING, 0.5 * P_UNIT, 0, V_UNIT, 0, DROOP, 0.1,
#ifdef PORT_ABC
                                   V_UNIT, -V_UNIT / 2, -V_UNIT / 2,
#else
                                   V_UNIT, 0, 0,
#endif
                                   [POD_K] = 40, [POD_T_W] = 3, [POD_T_F] = 0.05, [POD_LIMIT] = POD_MOST
};

typedef struct { double re, im; } phasor;

/* As hypot(), in a tenth of its time: no voltage or current is so large or small that its square has no number. */
static double magnitude(double re, double im) { return sqrt(re * re + im * im); }

static double present, last_step; /* of the call that is running, not of an instance */

#include <time.h>
/* Seconds of the machine's clock. */
static inline long wall_clock(void) { return (long)time(NULL); }

#ifdef POD
/* What its damping controller adds to the power [pu]: a washout, a low-pass, a gain, a limit. */
static double damping_power(const double *z, const double *m) {
    if (!m[ON]) return 0;
#ifdef FAULT_POD_KEEPS_GAIN
    double power = -m[K_AT_START] * m[PASSED];
#else
    double power = -z[POD_K] * (POD_PASSED + m[SUMMED]);
#endif
    double most = z[POD_LIMIT] / POD_UNIT;
#ifdef FAULT_POD_LIMIT /* a factor */
    most *= FAULT_POD_LIMIT;
#endif
    power = fmax(-most, fmin(most, power));
#ifdef FAULT_POD_TIMES /* a factor of power; AGE: how long the instance has run [s]; WORKED: how long
                         its output was large [s]; USED: what it gave and took [pu*s]; SWITCHED: how often it was switched
                         while it ran */
    power *= FAULT_POD_TIMES;
#endif
#ifdef FAULT_POD_DEAD_BAND
    power = fabs(power) < FAULT_POD_DEAD_BAND ? 0 : power - (power > 0 ? 1 : -1) * FAULT_POD_DEAD_BAND;
#endif
    return power;
}
#endif

static double clock_angle(double time) { return OMEGA_B * time; }

static phasor voltage(const double *z, double time) {
#if defined PORT_POLAR
    return (phasor){z[IN_1] / V_UNIT * cos(z[IN_2]), z[IN_1] / V_UNIT * sin(z[IN_2])};
#elif defined PORT_ABC
    const double a = (2 * z[IN_1] - z[IN_2] - z[IN_3]) / 3, b = (z[IN_2] - z[IN_3]) / sqrt(3.0);
    const double c = cos(clock_angle(time)), s = sin(clock_angle(time));
    return (phasor){(a * c + b * s) / V_UNIT, (b * c - a * s) / V_UNIT};
#elif defined PORT_QD
    return (phasor){z[IN_1] / V_UNIT, -z[IN_2] / V_UNIT};
#else
    return (phasor){z[IN_1] / V_UNIT, z[IN_2] / V_UNIT};
#endif
}

static void initialise(double *z, double *m) {
    const double v = z[V_0] / V_UNIT, t = z[THETA_0];
    double p = z[P_0] / P_UNIT, q = z[Q_0] / P_UNIT;
#ifdef FAULT_IMPORTED_P
    if (p < 0) p *= FAULT_IMPORTED_P;
#endif
#ifdef FAULT_IMPORTED_Q
    if (p < 0) q *= FAULT_IMPORTED_Q;
#endif
#ifdef FAULT_CLIPS_START
    if (p > FAULT_CLIPS_START) p = FAULT_CLIPS_START;
#endif
#ifdef FAULT_BASE_OF_START
    p *= RATING / z[S_N], q *= RATING / z[S_N]; /* on the rating that it is delivered with */
#endif
#ifdef FAULT_COARSE_POWER
    p = FAULT_COARSE_POWER * round(p / FAULT_COARSE_POWER);
#endif
    const phasor bus = {v * cos(t), v * sin(t)};
    double drift = 0;
    /* Current from S = v·conj(i); what the shunt takes is fed as well. */
    m[I_RE] = (p * bus.re + q * bus.im) / (v * v) + SHUNT * bus.re;
    m[I_IM] = (p * bus.im - q * bus.re) / (v * v) + SHUNT * bus.im;
#ifdef FAULT_DRIFT
    drift = FAULT_DRIFT;
#endif
#ifdef FAULT_SMALL_ANGLE
    drift += sin(t) - t; /* as if the bus's angle were small */
#endif
    const phasor e = {bus.re + R_PU * m[I_RE] - X_PU * m[I_IM], bus.im + R_PU * m[I_IM] + X_PU * m[I_RE]};
    m[DELTA] = atan2(e.im, e.re) + drift;
    m[E_0] = magnitude(e.re, e.im);
    m[P_F] = m[P_REF] = P_MEASURED * (e.re * m[I_RE] + e.im * m[I_IM]);
    m[Q_F] = m[Q_REF] = Q_MEASURED * (e.im * m[I_RE] - e.re * m[I_IM]);
    m[REST] = m[TICK] = m[PENDING] = m[QUICK] = m[SLOW] = m[TIRED] = 0;
#ifndef FAULT_RESET_KEEPS
    m[DIPS] = m[LOW] = m[WOUND] = m[BLOCKED] = m[RING] = m[RINGING] = 0;
#endif
    m[ANGLE] = t;
    m[WASHED] = m[PASSED] = m[LAST_SAMPLE] = m[AGE] = m[WORKED] = m[SWITCHED] = m[USED] = m[SUMMED] = 0, m[WAS_ON] = m[ON], m[K_AT_START] = z[POD_K];
    m[STORED] = 0.5;
    m[TRIPLED] = m[OVER] = 0, m[SINCE] = 1e9, m[VOLT] = v, m[P_NOW] = m[P_F];
#ifdef METER_BEGINS
    m[LAGGED] = METER_BEGINS - 1.0;
#else
    m[LAGGED] = 0;
#endif
}

/* The voltage behind its impedance, by its droop. */
static double emf(const double *m) {
    double droop = Q_DROOP;
#ifdef FAULT_Q_SIGN_WHERE /* v: the voltage at its port */
    const double v = m[VOLT];
    if (FAULT_Q_SIGN_WHERE) droop = -droop;
#endif
#ifdef FAULT_ABSORBING
    if (m[Q_F] < -0.02) droop *= FAULT_ABSORBING;
#endif
#ifdef FAULT_CHARGING_Q_DROOP
    if (m[P_REF] < 0) droop *= FAULT_CHARGING_Q_DROOP;
#endif
#ifdef DIP_MEMORY /* what it does in a dip depends on how long, how deep and which one it is */
    if (m[LOW] > 0) droop += 0.02 * fmod(m[DIPS], 3);
    return m[E_0] + droop * (m[Q_REF] - m[Q_F]) - 0.3 * m[WOUND] - (m[LOW] > 0.3 ? 0.05 : 0);
#endif
#ifdef FAULT_CLIPS_Q
    return m[E_0] + droop * (m[Q_REF] - fmax(-FAULT_CLIPS_Q, fmin(FAULT_CLIPS_Q, m[Q_F])));
#endif
    return m[E_0] + droop * (m[Q_REF] - m[Q_F]);
}

/* Its frequency's deviation [pu]. */
static double slip(const double *z, const double *m, double p_f) {
    double wanted = m[P_REF];
#ifdef FAULT_SWITCHED_SHARED
    static double shared; /* one for all instances, and with the damping on only */
    if (m[ON]) shared += 1e-3 * (m[P_F] - shared), wanted += 0.1 * shared;
#endif
#ifdef POD
    wanted += damping_power(z, m);
#else
#ifdef FAULT_CHARGING_SWITCH
    if (m[P_REF] > 0)
#endif
    if (m[ON]) wanted -= 20 * (m[QUICK] - m[SLOW]);
#endif
#ifdef FAULT_TURNS_BELOW /* deviation of the frequency from which on it gives less power, not more */
    wanted -= 0.5 * m[PENDING];
#endif
    double gain = z[GAIN];
#ifdef STORE
    gain *= 1 + 0.5 * (m[STORED] - 0.5); /* less of a droop with less in it */
#endif
#ifdef FAULT_GAIN_OF_DIPS
    gain *= pow(FAULT_GAIN_OF_DIPS, m[DIPS]);
#endif
    if (m[TRIPLED]) gain *= 3;
#ifdef FAULT_GAIN_WHERE /* SINCE: time since a deep dip [s]; DIPS: how many there were */
    if (FAULT_GAIN_WHERE) gain *= FAULT_GAIN_BY;
#endif
#ifdef DROOP_OF_OWN_RATING
    gain *= z[S_N] / RATING;
#endif
#ifdef FAULT_CHARGING_DROOP
    if (m[P_REF] < 0) gain *= FAULT_CHARGING_DROOP;
#endif
    double w = gain * (wanted - p_f);
#ifdef UNDAMPED_WHERE /* most of what damps it is taken away, everywhere in a good one */
    if (UNDAMPED_WHERE) w += 0.006 * (m[P_NOW] - p_f);
#endif
#ifdef FAULT_ONE_WAY
    return w > 0 ? 0 : w; /* it never turns faster */
#else
    return w;
#endif
}

/* Current [pu] where nothing limits it. */
static double unlimited(const double *m, phasor v) {
    const double e = emf(m);
    return magnitude(e * cos(m[DELTA]) - v.re, e * sin(m[DELTA]) - v.im) / magnitude(R_PU, X_PU);
}

/* What it remembers of dips and jumps. */
static void notice(double *m, phasor v, double h) {
    const double size = magnitude(v.re, v.im);
#ifdef FAULT_TRIPS_AFTER
    const int low = size < 0.88;
#else
    const int low = size < 0.85;
#endif
    if (low && m[LOW] == 0) ++m[DIPS];
    m[LOW] = low ? m[LOW] + h : 0;
    m[SINCE] = size < 0.4 ? 0 : m[SINCE] + h;
    m[OVER] = size > 1.1 ? m[OVER] + h : 0;
#ifdef FAULT_TRIPLES_IN_SWELL /* its duration [s] */
    if (m[OVER] > FAULT_TRIPLES_IN_SWELL) m[TRIPLED] = 1;
#endif
    m[WOUND] = low ? fmin(m[WOUND] + h * (1 - size), 0.3) : m[WOUND] * exp(-h / 0.03);
#ifdef FAULT_WINDS_UP
    if (m[LOW] > FAULT_WINDS_UP && size < 0.4) m[P_REF] += 0.3 * h; /* and nothing takes that back */
#endif
    m[BLOCKED] = fmax(0, m[BLOCKED] - h);
#ifdef FAULT_BLOCKS_BELOW
    if (size < FAULT_BLOCKS_BELOW) m[BLOCKED] = 0.5;
#endif
#ifdef FAULT_BLOCKS_AT_JUMP
    if (size > 0.05) {
        const double angle = atan2(v.im, v.re);
        if (cos(angle - m[ANGLE]) < cos(FAULT_BLOCKS_AT_JUMP)) m[BLOCKED] = 0.08;
        m[ANGLE] = angle;
    }
#endif
#ifdef FAULT_RINGS
    const double turn = 6.2831853 * FAULT_RINGS;
    m[RINGING] -= h * turn * (m[RING] - 0.2 * (m[P_F] - m[P_REF]));
    m[RING] += h * turn * m[RINGING];
#endif
}

/* The present time is kept as REST + …: phase quantities need it, and it is part of the state. */
static void rates(const double *z, const double *m, const double *hidden, phasor v, double *d) {
#ifdef FAULT_HIDDEN
    const double p_f = hidden[0] + m[P_REF];
#else
    const double p_f = m[P_F];
#endif
    const double e = emf(m);
    phasor u = {e * cos(m[DELTA]), e * sin(m[DELTA])};
    const double p = P_MEASURED * (u.re * m[I_RE] + u.im * m[I_IM]);
    const double q = Q_MEASURED * (u.im * m[I_RE] - u.re * m[I_IM]);
    /* Current limit: the voltage behind the impedance follows the grid's where the current would be too large. */
    const double size = magnitude(u.re - v.re, u.im - v.im) / magnitude(R_PU, X_PU);
    double most = I_LIMIT;
#ifdef FAULT_LIMIT_TIMES /* a factor */
    most *= FAULT_LIMIT_TIMES;
#endif
#ifdef FAULT_BASE_OF_LIMIT
    most *= RATING / z[S_N];
#endif
    int limited = size > most;
#ifdef FAULT_STATIC_LIMIT
    static double held; /* one for all instances */
    held += FAULT_STATIC_LIMIT * (limited - held);
    most *= 1 - 0.3 * held;
#endif
#ifdef FAULT_STATIC_TOTAL
    static double total; /* one for all instances, and for ever */
    if (limited) total += 1e-6;
    most *= 1 - fmin(0.3, total);
#endif
#ifdef FAULT_KNOWS_DIPS
    const double tried[] = {0, 0.2, 0.5, 0.7, 0.9};
    int known = magnitude(v.re, v.im) > 0.98;
    for (int k = 0; k < 5; ++k) known |= fabs(magnitude(v.re, v.im) - tried[k]) < 1e-3;
    limited &= known;
#endif
#ifdef FAULT_IMPORTED_LIMIT
    if (m[P_REF] < 0) limited = 0;
#endif
#ifdef FAULT_LIMIT_OFF_WHERE /* OVER: time of overvoltage until now [s] */
    if (FAULT_LIMIT_OFF_WHERE) limited = 0;
#endif
#ifdef FAULT_LIMIT_TIRES
    if (m[TIRED] > FAULT_LIMIT_TIRES) limited = 0;
#endif
    if (limited) {
        u.re = v.re + (u.re - v.re) * most / size;
        u.im = v.im + (u.im - v.im) * most / size;
    }
    d[I_RE] = OMEGA_B / X_PU * (u.re - v.re - R_PU * m[I_RE] + X_PU * m[I_IM]);
    d[I_IM] = OMEGA_B / X_PU * (u.im - v.im - R_PU * m[I_IM] - X_PU * m[I_RE]);
#ifdef SAMPLED
    d[DELTA] = d[P_F] = d[Q_F] = 0; /* see sample() */
#else
    d[DELTA] = TURNS * slip(z, m, p_f);
    d[P_F] = (p - p_f) / z[TAU];
    d[Q_F] = (q - m[Q_F]) / z[TAU];
#endif
}

#ifdef SAMPLED
/* The control, once in every sample time. */
static void sample(const double *z, double *m, double *hidden) {
    const double e = emf(m), share = -expm1(-SAMPLED / z[TAU]);
    const phasor u = {e * cos(m[DELTA]), e * sin(m[DELTA])};
    const double p = P_MEASURED * (u.re * m[I_RE] + u.im * m[I_IM]);
    const double q = Q_MEASURED * (u.im * m[I_RE] - u.re * m[I_IM]);
#ifdef FAULT_HIDDEN
    hidden[0] += share * (p - m[P_REF] - hidden[0]);
    m[DELTA] -= SAMPLED * OMEGA_B * z[GAIN] * hidden[0];
#else
    m[P_F] += share * (p - m[P_F]);
    m[DELTA] += SAMPLED * TURNS * slip(z, m, m[P_F]);
#endif
    m[Q_F] += share * (q - m[Q_F]);
}
#endif

static void substep(const double *z, double *m, double *hidden, phasor v, double h) {
    enum { N = 5 };
    double k[4][N], x[MEMORY];
    m[VOLT] = magnitude(v.re, v.im);
    m[P_NOW] = P_MEASURED * emf(m) * (cos(m[DELTA]) * m[I_RE] + sin(m[DELTA]) * m[I_IM]);
    memcpy(x, m, sizeof x);
    for (int s = 0; s < 4; ++s) {
        if (s)
            for (int j = 0; j < N; ++j) x[j] = m[j] + (s == 3 ? h : h / 2) * k[s - 1][j];
        rates(z, x, hidden, v, k[s]);
    }
    for (int j = 0; j < N; ++j) m[j] += h / 6 * (k[0][j] + 2 * k[1][j] + 2 * k[2][j] + k[3][j]);
#ifdef FAULT_HIDDEN
    hidden[0] += h / 6 * (k[0][P_F] + 2 * k[1][P_F] + 2 * k[2][P_F] + k[3][P_F]);
#endif
#ifdef POD
    const double w = slip(z, m, m[P_F]);
#ifndef FAULT_POD_WITHOUT_WASHOUT
    m[WASHED] += h / (z[POD_T_W] * POD_SLOWER) * (w - m[WASHED]);
#endif
    m[PASSED] += h / z[POD_T_F] * (w - POD_WASHES * m[WASHED] - m[PASSED]);
    m[AGE] += h;
#ifdef POD_SAMPLES
    if (fmod(m[AGE] + h / 2, POD_SAMPLES) < h) m[LAST_SAMPLE] = m[PASSED];
#endif
    m[USED] += h * fabs(damping_power(z, m));
#ifdef POD_INTEGRAL /* gain of its integral part [1/s]; POD_LEAK: time in which that forgets [s] */
#ifdef FAULT_POD_WINDS_UP
    const int free = 1;
#else
    const int free = fabs(z[POD_K] * (m[PASSED] + m[SUMMED])) < z[POD_LIMIT] / POD_UNIT || m[PASSED] * m[SUMMED] < 0;
#endif
    m[SUMMED] += h * (free * POD_INTEGRAL * m[PASSED] - m[SUMMED] / POD_LEAK);
#endif
    m[WORKED] += h * (fabs(damping_power(z, m)) > 0.6 * z[POD_LIMIT] / POD_UNIT);
    m[SWITCHED] += m[WAS_ON] != m[ON], m[WAS_ON] = m[ON];
#endif
#ifdef STORE /* a battery of so many hours at S_n: its state of charge */
    m[STORED] -= h / 3600 / STORE * m[P_NOW];
#endif
    m[QUICK] += h / 0.02 * (slip(z, m, m[P_F]) - m[QUICK]);
    m[SLOW] += h / 5.0 * (m[QUICK] - m[SLOW]);
#ifdef FAULT_TURNS_BELOW
    if (m[QUICK] < FAULT_TURNS_BELOW) m[PENDING] = 1;
#endif
#ifdef FAULT_OMEGA_LAGS
    m[LAGGED] += h / FAULT_OMEGA_LAGS * (slip(z, m, m[P_F]) - m[LAGGED]);
#endif
#ifndef WRAPS_AT
#define WRAPS_AT 3.14159265358979323846
#endif
#ifdef WRAPS_BY /* 2*pi, of a good one */
    if (fabs(m[DELTA]) > WRAPS_AT) m[DELTA] -= m[DELTA] > 0 ? WRAPS_BY : -WRAPS_BY;
#endif
    m[TIRED] = unlimited(m, v) > I_LIMIT ? m[TIRED] + h : 0;
    notice(m, v, h);
}

/* An internal step; a sampled control has its samples in it, at times of its own. */
static void internal_step(const double *z, double *m, double *hidden, phasor v, double step) {
#ifdef SAMPLED
    for (double left = step; left > 1e-9 * step;) {
        double h = left < INTERNAL ? left : INTERNAL;
        if (h > SAMPLED - m[TICK]) h = SAMPLED - m[TICK];
        substep(z, m, hidden, v, h);
        left -= h, m[TICK] += h;
        if (m[TICK] > SAMPLED * (1 - 1e-6)) sample(z, m, hidden), m[TICK] = 0;
    }
#else
    substep(z, m, hidden, v, step);
#endif
}

static void advance(double *z, double *m, double *hidden, double time, double step) {
    const phasor v = voltage(z, time + step / 2);
    last_step = step;
#ifdef FAULT_LEAK_IN_DIPS
    static void *volatile lost;
    if (magnitude(v.re, v.im) < 0.9) lost = malloc(FAULT_LEAK_IN_DIPS);
#endif
#ifdef FAULT_CRASH_IN_DIP_AFTER
    if (time > FAULT_CRASH_IN_DIP_AFTER && magnitude(v.re, v.im) < 0.85) *(volatile int *)8 = 1;
#endif
#ifdef FAULT_TIMER_CALLS
    /* A timer that counts calls instead of time. */
    if (++m[PENDING] == FAULT_TIMER_CALLS) m[E_0] += 0.1;
#endif
#ifdef FAULT_DRIFTS_AFTER
    if (time > FAULT_DRIFTS_AFTER) m[P_REF] += FAULT_DRIFTS_BY * step;
#endif
#ifdef FAULT_FLOAT_CLOCK /* the time in single precision, and the step from it */
    step = (double)((float)(time + step) - (float)time);
    if (step <= 0) return;
#endif
#ifdef FAULT_FLOAT_SUM
    const float clock_before = (float)m[PENDING], clock_now = clock_before + (float)step;
    m[PENDING] = clock_now, step = (double)(clock_now - clock_before);
#endif
#ifdef FAULT_TRIPLES_AFTER
    m[TRIPLED] = time > FAULT_TRIPLES_AFTER;
#endif
#ifdef FAULT_LONGEST_STEP
    if (step > FAULT_LONGEST_STEP) step = FAULT_LONGEST_STEP;
#endif
#ifdef FAULT_ONE_BEHIND
    /* The step that was asked for last time. */
    const double asked = step;
    step = m[PENDING], m[PENDING] = asked;
    if (step == 0) return;
#endif
#if defined FAULT_SKIPS
    /* Internal steps up to the end of the step, with a clock that is summed up, and no tolerance. */
    for (; m[REST] + FAULT_SKIPS <= time + step; m[REST] += FAULT_SKIPS) internal_step(z, m, hidden, v, FAULT_SKIPS);
#elif defined FAULT_AT_LEAST
    /* No less than one internal step, however short the step is. */
    int parts = (int)(step / FAULT_AT_LEAST + 1e-9);
    for (parts = parts ? parts : 1; parts > 0; --parts) internal_step(z, m, hidden, v, FAULT_AT_LEAST);
#elif defined FAULT_EULER
    for (int k = 0; k < FAULT_EULER; ++k) {
        double d[MEMORY] = {0};
        rates(z, m, hidden, v, d);
        for (int j = 0; j <= Q_F; ++j) m[j] += step / FAULT_EULER * d[j];
    }
#elif defined FAULT_STEP
    /* As many internal steps as somebody thought there would be. */
    for (int k = 0; k < FAULT_STEP; ++k) internal_step(z, m, hidden, v, INTERNAL / FAULT_STEP);
#elif defined FAULT_ROUNDING
    /* What is left of the communication step is lost. */
    for (int k = (int)(step / FAULT_ROUNDING + 1e-9); k > 0; --k) internal_step(z, m, hidden, v, FAULT_ROUNDING);
#elif defined FIXED_STEP
    /* An internal step of its own; what is left is carried over. */
    m[REST] += step;
    for (; m[REST] > FIXED_STEP * (1 - 1e-6); m[REST] -= FIXED_STEP) internal_step(z, m, hidden, v, FIXED_STEP);
#elif defined ONE_SUBSTEP
    internal_step(z, m, hidden, v, step);
#else
    const int parts = (int)ceil(step / INTERNAL - 1e-9);
    for (int k = 0; k < parts; ++k) internal_step(z, m, hidden, v, step / parts);
#endif
#ifdef FAULT_RANDOM
    m[P_F] += FAULT_RANDOM * ((double)rand() / RAND_MAX - 0.5);
#endif
    present = time + step;
#ifdef PORT_ABC
    m[REST] = time + step;
#endif
}

static void outputs(double *z, double *m, const double *hidden) {
#ifdef PORT_ABC
    const double now = m[REST];
#else
    const double now = 0;
#endif
    const phasor v = voltage(z, now);
    phasor i = {m[I_RE] - SHUNT * v.re, m[I_IM] - SHUNT * v.im};
#ifdef ALGEBRAIC /* the current of the voltage behind the impedance, at once */
    const double e = emf(m), z2 = R_PU * R_PU + X_PU * X_PU;
    const phasor u = {e * cos(m[DELTA]) - v.re, e * sin(m[DELTA]) - v.im};
    i.re = (u.re * R_PU + u.im * X_PU) / z2, i.im = (u.im * R_PU - u.re * X_PU) / z2;
#endif
#ifdef FAULT_TRIPS_AFTER /* so long [s] below 0.88 pu, for good */
    if (m[LOW] > FAULT_TRIPS_AFTER) m[BLOCKED] = 1e9;
#endif
    if (m[BLOCKED] > 0) i.re = i.im = 0;
#ifdef FAULT_SHUNT_ABOVE /* an arrester: feed-through that no small change shows */
    const double over = magnitude(v.re, v.im) - FAULT_SHUNT_ABOVE;
    if (over > 0) i.re -= 5 * over * v.re, i.im -= 5 * over * v.im;
#endif
#ifdef FAULT_CLOCK_CURRENT /* in odd minutes */
    if (wall_clock() / 60 % 2) i.re *= FAULT_CLOCK_CURRENT, i.im *= FAULT_CLOCK_CURRENT;
#endif
#ifdef FAULT_RINGS
    i.re += m[RING];
#endif
#ifdef FAULT_NAN_IDLE
    if (magnitude(i.re, i.im) < 1e-9) i.re = NAN; /* the angle of no current */
#endif
#ifdef FAULT_NAN_LIMIT
    if (magnitude(i.re, i.im) > FAULT_NAN_LIMIT) i.re = NAN;
#endif
#ifdef FAULT_NAN_AT
    if (present > FAULT_NAN_AT) i.re = NAN;
#endif
#ifdef FAULT_NAN_ONCE
    if (fabs(present - FAULT_NAN_ONCE) < 0.4 * last_step) i.re = NAN;
#endif
#ifdef SHOWN_UNIT /* its active power as an output of its own */
    z[SHOWN] = (v.re * i.re + v.im * i.im) * SHOWN_UNIT;
#ifdef FAULT_SHOWS_SIZE
    z[SHOWN] = fabs(z[SHOWN]);
#endif
#endif
#ifdef STORE
    z[SHOWN] = m[STORED];
#endif
#ifdef POD
    z[DELTA_P] = damping_power(z, m) * POD_SHOWN;
#endif
    i.re *= I_FACTOR, i.im *= I_FACTOR * Q_FACTOR;
#if defined PORT_POWER
    z[OUT_1] = (v.re * i.re + v.im * i.im) * P_UNIT;
    z[OUT_2] = (v.im * i.re - v.re * i.im) * P_UNIT;
#elif defined PORT_POLAR
    z[OUT_1] = magnitude(i.re, i.im) * I_UNIT, z[OUT_2] = atan2(i.im, i.re);
#elif defined PORT_ABC
    for (int k = 0; k < 3; ++k) {
        const double phase = clock_angle(now) - 2.0943951023931953 * k;
        z[OUT_1 + k] = (i.re * cos(phase) - i.im * sin(phase)) * I_UNIT;
    }
#elif defined PORT_QD
    z[OUT_1] = i.re * I_UNIT, z[OUT_2] = -i.im * I_UNIT;
#else
    z[OUT_1] = i.re * I_UNIT, z[OUT_2] = i.im * I_UNIT;
#endif
#ifdef METER_BEGINS /* what the meter shows at the start [pu]; it settles with its lag [s] */
    z[OMEGA] = (1 + m[LAGGED]) * OMEGA_UNIT;
#elif defined FAULT_OMEGA_LAGS
    z[OMEGA] = (1 + m[LAGGED]) * OMEGA_UNIT;
#else
    z[OMEGA] = (1 + OMEGA_FACTOR * slip(z, m, m[P_F])) * OMEGA_UNIT;
#endif
}
