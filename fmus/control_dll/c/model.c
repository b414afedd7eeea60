/* A model as IEEE/CIGRE DLL. Nothing here is kept between calls but in the host's arrays, so any number of instances
   run beside one another, and a host that saves its arrays has saved the state.

   Generated above: the kernel, INFO, the structure `parameters` with the place of each member (AT), which are whole
   numbers (WHOLE), which are fixed (FIXED), their bounds, and every text that an error may need. */
enum { NV = DX + NX };

static int32_t fails(struct dll_instance *s, const char *text) {
    s->error = text;
    return SAID_ERROR;
}

static void take_parameters(const struct dll_instance *s, double *z) {
    for (int i = 0; i < NP; ++i) {
        const char *from = (const char *)s->parameters + AT[i];
        z[i] = WHOLE[i] ? *(const int32_t *)from : *(const double *)from;
    }
}

/* A mark of the parameters' values, in two integer states; of the fixed ones alone, or of all. */
static void mark(const double *z, int fixed_alone, int32_t *to) {
    uint64_t mixed = 14695981039346656037u, word;
    for (int i = 0; i < NP; ++i)
        if (FIXED[i] || !fixed_alone) {
            memcpy(&word, z + i, sizeof word);
            mixed = (mixed ^ word) * 1099511628211u;
            mixed ^= mixed >> 29;
        }
    memcpy(to, &mixed, sizeof mixed);
}

static int32_t check(struct dll_instance *s, double *z) {
    double margins[NR + 1], start[NX];
    for (int i = 0; i < NP; ++i)
        if (!(z[i] >= LEAST[i] && z[i] <= MOST[i])) return fails(s, OUT_OF_BOUNDS[i]);
    const double *arg[] = {z};
    double *res[] = {z + C, start};
    initialise_code(arg, res);
    requirements(z, NULL, margins);
    for (int i = 0; i < NR; ++i)
        if (!(margins[i] > 0)) return fails(s, RULE[i]);
    return SAID_NOTHING;
}

/* What follows from the parameters, into z; an error where they were changed to what is not allowed. */
static int32_t follow_parameters(struct dll_instance *s, double *z) {
    int32_t seen[2];
    double start[NX];
    take_parameters(s, z);
    mark(z, 0, seen);
    if (memcmp(seen, s->ints + ALL_MARK, sizeof seen)) {
        int32_t fixed[2];
        mark(z, 1, fixed);
        if (memcmp(fixed, s->ints + FIXED_MARK, sizeof fixed)) return fails(s, FIXED_CHANGED);
        if (check(s, z)) return SAID_ERROR;
        memcpy(s->ints + ALL_MARK, seen, sizeof seen);
    }
    const double *arg[] = {z};
    double *res[] = {z + C, start};
    initialise_code(arg, res);
    return SAID_NOTHING;
}

static int32_t give_outputs(struct dll_instance *s, double *z, double *w) {
    memcpy(z + U, s->inputs, NU * sizeof *z);
    for (int i = 0; i < NU; ++i)
        if (!isfinite(z[U + i])) return fails(s, INPUT_NOT_FINITE[i]);
    outputs(z, w);
    memcpy(s->outputs, z + Y, NY * sizeof *z);
    return SAID_NOTHING;
}

EXPORT const struct dll_info *CALLED Model_GetInfo(void) { return &INFO; }

EXPORT int32_t CALLED Model_PrintInfo(void) {
    puts(TITLE);
    return SAID_NOTHING;
}

EXPORT int32_t CALLED Model_FirstCall(struct dll_instance *s) {
    memset(s->ints, 0, NI * sizeof *s->ints);
    return SAID_NOTHING;
}

EXPORT int32_t CALLED Model_CheckParameters(struct dll_instance *s) {
    double z[NV];
    if (s->mode == RMS) return fails(s, FOR_EMT);
    take_parameters(s, z);
    return check(s, z);
}

/* Computes the state of the operating point. May be repeated while a host holds the model at its start: what turns with
   the network frame then turns on with the time. */
EXPORT int32_t CALLED Model_Initialize(struct dll_instance *s) {
    double z[NV] = {0}, rate[NX], w[WORKSPACE] = {0};
    s->ints[READY] = 0;
    if (Model_CheckParameters(s)) return SAID_ERROR;
    take_parameters(s, z);
    initialise(z, NULL);
    memcpy(z + U, s->inputs, NU * sizeof *z);
    enter(z, w);
    if (NS) rates(z, z + X, rate, w);
    for (int i = 0; i < NS; ++i) z[X + STEPWISE[i]] += rate[STEPWISE[i]] * s->time;
    for (int i = 0; i < NX; ++i)
        if (!isfinite(z[X + i])) return fails(s, NO_START);
    memcpy(s->doubles, z + X, NX * sizeof *z);
    mark(z, 1, s->ints + FIXED_MARK);
    mark(z, 0, s->ints + ALL_MARK);
    if (give_outputs(s, z, w)) return SAID_ERROR;
    s->ints[READY] = 1;
    return SAID_NOTHING;
}

/* Outputs from the state and the inputs of this sample; then the state of the next one. */
EXPORT int32_t CALLED Model_Outputs(struct dll_instance *s) {
    double z[NV], w[WORKSPACE] = {0};
    if (!s->ints[READY]) return fails(s, NOT_STARTED);
    if (follow_parameters(s, z)) return SAID_ERROR;
    memcpy(z + X, s->doubles, NX * sizeof *z);
    if (give_outputs(s, z, w)) return SAID_ERROR;
    const int parts = (int)ceil(SAMPLE_TIME / z[INTERNAL_STEP] - 1e-9), n = parts > 1 ? parts : 1;
    const int bad = advance(z, SAMPLE_TIME / n, n, w);
    if (bad) return fails(s, STATE_NOT_FINITE[bad - 1]);
    memcpy(s->doubles, z + X, NX * sizeof *z);
    return SAID_NOTHING;
}

/* For RMS programs, which Model_CheckParameters refuses: there is nothing to iterate. */
EXPORT int32_t CALLED Model_Iterate(struct dll_instance *s) { return s->mode == RMS ? fails(s, FOR_EMT) : SAID_NOTHING; }

EXPORT int32_t CALLED Model_Terminate(struct dll_instance *s) {
    s->ints[READY] = 0;
    return SAID_NOTHING;
}
