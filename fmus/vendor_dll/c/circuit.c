/* The circuit around the controller: integrated between two samples, measured at each.

   Generated above: the kernel of the circuit's model, whose quantities lie in `circuit`; places in it (AT_...); MEASURED
   and DRIVEN, which value goes to which place of the DLL and back; DELAY, TRIM_P, TRIM_Q, TRIM_V, LONGEST_START. */
static const double TURN = 6.283185307179586;
enum { PARTS_OF_PERIOD = 20 };
static const double AT_REST = 1e-11, NEAR_REST = 1e-4; /* largest mismatch of P and Q [pu], to stop; to go on at the end */
static const double ALIKE = 1e-2; /* mismatch of P and Q [pu] from which it does not run at the other frequency */

/* The network frame's angle: 0 at the start of the experiment. */
static double angle_at(const struct instance *s, double time) {
    const double turns = s->circuit[AT_FREQUENCY] * (time - s->start);
    return TURN * (turns - floor(turns));
}

static void circuit_refresh(struct instance *s, double time) {
    s->circuit[AT_ANGLE] = angle_at(s, time);
    double room[WORKSPACE] = {0};
    circuit_outputs(s->circuit, room);
    s->old = 0;
}

static int circuit_check(struct instance *s) {
    double margins[RULES + 1];
    circuit_requirements(s->circuit, NULL, margins);
    for (int i = 0; i < RULES; ++i)
        if (!(margins[i] > 0)) return say(s, ERROR, "parameters cannot be used: %s", RULE[i]);
    return OK;
}

static int circuit_advance(struct instance *s, double from, double to) {
    const double length = to - from, shortest = 1e-6 * (SAMPLE_TIME > 0 ? SAMPLE_TIME : length);
    if (length <= shortest) return OK;
    const int parts = (int)ceil(length / s->circuit[AT_INTERNAL_STEP] - 1e-6);
    double room[WORKSPACE] = {0};
    s->circuit[AT_ANGLE] = angle_at(s, from);
    if (circuit_advance_parts(s->circuit, length / (parts > 1 ? parts : 1), parts > 1 ? parts : 1, room))
        return say(s, ERROR, "the circuit's states are no longer finite after t = %.9g s", from);
    return OK;
}

static double on_base(const struct instance *s, const struct route *r) {
    return r->factor * (r->base < 0 ? 1.0 : s->circuit[r->base]);
}

static void drive(struct instance *s) {
    for (int i = 0; i < 3; ++i)
        s->circuit[DRIVEN[i].place] = load(s->buffer[1] + DRIVEN[i].offset, DRIVEN[i].type) * on_base(s, DRIVEN + i);
}

/* A delay of one sample stands for computation and modulation: what was computed at the last sample is applied now. */
static void circuit_before(struct instance *s, double time) {
    circuit_refresh(s, time);
    for (int i = 0; i < MEASUREMENTS; ++i)
        store(s->buffer[0] + MEASURED[i].offset, MEASURED[i].type, s->circuit[MEASURED[i].place] * on_base(s, MEASURED + i));
    if (DELAY) drive(s);
}

static void circuit_after(struct instance *s) {
    if (!DELAY) drive(s);
    s->old = 1;
}

/* One period of the network; mean of P and Q at the bus over it. */
static int one_period(struct instance *s, double time, double period, double *p, double *q) {
    *p = *q = 0;
    for (int k = 0; k < PARTS_OF_PERIOD; ++k) {
        const int status = pass(s, time + k * (period / PARTS_OF_PERIOD), period / PARTS_OF_PERIOD);
        if (status) return status;
        circuit_refresh(s, s->time);
        *p += s->circuit[AT_P] / PARTS_OF_PERIOD;
        *q += s->circuit[AT_Q] / PARTS_OF_PERIOD;
    }
    return OK;
}

static double limited(double value) { return fmin(fmax(value, -0.5), 0.5); }

/* The start: the controller runs at the power flow's voltage, and its references are trimmed until it delivers P_0, Q_0.

   It begins a whole number of periods before the start, so that the frame's angle is 0 where it ends. */
static int start_at_frequency(struct instance *s) {
    double *z = s->circuit, p = 0, q = 0;
    int status = circuit_check(s);
    if (status) return status;
    z[AT_TRIM_P] = z[AT_TRIM_Q] = z[AT_TRIM_V] = 0;
    circuit_initialise(z, NULL);
    drive(s);
    const double v[] = {z[AT_V_RE], z[AT_V_IM]}, period = 1 / z[AT_FREQUENCY];
    const int most = (int)ceil((s->probing ? 0.25 : 1.0) * LONGEST_START / period), first = (int)ceil(FIRST_TRIM / period);
    const double gain = period / TRIM_TIME;
    z[AT_V_RE] = z[AT_V_0] * cos(z[AT_THETA_0]), z[AT_V_IM] = z[AT_V_0] * sin(z[AT_THETA_0]);
    s->begin = s->clock = s->start;
    s->samples = 0;
    int n = 0, resting = 0;
    while (n < most && resting < 5) {
        status = one_period(s, s->start + n * period, period, &p, &q);
        if (status) return status;
        ++n;
        const double dp = TRIM_P ? z[AT_P_0] - p : 0, dq = TRIM_Q || TRIM_V ? z[AT_Q_0] - q : 0;
        resting = n > first && fabs(dp) < AT_REST && fabs(dq) < AT_REST ? resting + 1 : 0;
        if (n <= first) continue;
        z[AT_TRIM_P] = limited(z[AT_TRIM_P] + gain * dp);
        if (TRIM_Q) z[AT_TRIM_Q] = limited(z[AT_TRIM_Q] + gain * dq);
        if (TRIM_V) z[AT_TRIM_V] = limited(z[AT_TRIM_V] + gain * dq * V_PER_Q);
    }
    const double off_p = p - z[AT_P_0], off_q = q - z[AT_Q_0];
    const double near_rest = s->probing ? ALIKE : NEAR_REST;
    if (!(fabs(off_p) < near_rest && fabs(off_q) < near_rest))
        return say(s, ERROR, "after %.3g s at the power flow's voltage it delivers P = %.6g and Q = %.6g; the power flow asks for "
                   "%.6g and %.6g [pu]: check [inputs], [bridge] and [start] of the device's file, and the DLL's parameters",
                   n * period, p, q, z[AT_P_0], z[AT_Q_0]);
    if (resting < 5)
        say(s, WARNING, "after %.3g s at the power flow's voltage P and Q still miss by %.2g and %.2g pu", n * period, off_p, off_q);
    z[AT_V_RE] = v[0], z[AT_V_IM] = v[1];
    s->begin = s->clock = s->start - n * period;
    s->time = s->start;
    circuit_refresh(s, s->time);
    return OK;
}

/* Whether it starts, shortly, at the other of the two frequencies that networks have; the controller is a new one. */
static int starts_at(struct instance *s, double frequency) {
    double kept[CIRCUIT_SIZE + 1];
    void *logger = s->logger;
    memcpy(kept, s->circuit, sizeof kept);
    unload(s);
    s->logger = NULL, s->probing = 1, s->started = 0;
    s->circuit[AT_FREQUENCY] = frequency;
    const int status = load_dll(s) ? ERROR : initialise(s);
    memcpy(s->circuit, kept, sizeof kept);
    s->logger = logger, s->probing = 0;
    return status <= WARNING;
}

static int circuit_start(struct instance *s) {
    const int status = start_at_frequency(s);
    const double f_n = s->circuit[AT_FREQUENCY], other = f_n > 55 ? 50 : 60;
    if (status <= WARNING || s->probing || circuit_check(s) || !starts_at(s, other)) return status;
    return say(s, ERROR, "in a network of %g Hz it starts, and here f_n = %g Hz: its control is made for %g Hz, which is the likely cause; "
               "give f_n = %g in [circuit] of the device's file, in the case that it stands in, or to gfor fmu check as --frequency", other, f_n, other, other);
}
