/* Instances of one model that step side by side, each in a lane, with the bits that each has alone. What is out of the
   ordinary, one of them alone or a processor without wide registers: they step one by one. */
#ifdef STACKED

/* Parameters of instances and what these fix, side by side as a step takes them: they stay from step to step, and an
   instance's own need not come from memory. */
struct beside {
    const struct instance *of[LANES];
    lanes p[U + 1], h[NH + 1];
};

static int is_of(const struct beside *b, struct instance *const *s) {
    for (int lane = 0; lane < LANES; ++lane)
        if (s[lane]->beside != b || b->of[lane] != s[lane]) return 0;
    return 1;
}

/* What the first instance keeps for all, made where they are not as they were; NULL without memory. Only its own memory
   is read: an instance that led another of them before may be gone. */
static struct beside *parameters_of(struct instance *const *s) {
    struct instance *first = s[0];
    if (!first->own_beside) first->own_beside = calloc(1, sizeof(struct beside) + _Alignof(struct beside));
    if (!first->own_beside) return NULL;
    const uintptr_t most = (uintptr_t)first->own_beside + _Alignof(struct beside);
    struct beside *b = (struct beside *)(most - most % _Alignof(struct beside));
    if (is_of(b, s)) return b;
    for (int lane = 0; lane < LANES; ++lane) {
        const double *z = s[lane]->z, *fixed = s[lane]->work + AT_FIXED;
        double *p = (double *)b->p + lane, *h = (double *)b->h + lane;
        for (int i = 0; i < U; ++i) p[LANES * i] = z[i];
        for (int i = 0; i < NH; ++i) h[LANES * i] = fixed[i];
        b->of[lane] = s[lane];
        s[lane]->beside = b;
    }
    return b;
}

/* One step of as many instances, with functions that were compiled for the same registers. Nothing is written where a
   state is no longer finite; returns whether all are. */
IN_PLACE int step_lanes(struct instance *const *s, const struct beside *b, void (*rates_of)(const lanes **, lanes **),
                        void (*outputs_of)(const lanes **, lanes **)) {
    lanes u[NU + 1], x[NX + 1], y[NY + 1], t[NX + 1], k1[NX + 1], k2[NX + 1], k3[NX + 1], k4[NX + 1];
    lanes moved[NS + 1], rest = {0};
    for (int lane = 0; lane < LANES; ++lane) {
        const double *z = s[lane]->z;
        for (int i = 0; i < NU; ++i) u[i][lane] = z[U + i];
        for (int i = 0; i < NX; ++i) x[i][lane] = z[X + i];
    }
    const double part = s[0]->part;
    const int parts = s[0]->parts;
    lanes *of_x[] = {k1}, *of_t2[] = {k2}, *of_t3[] = {k3}, *of_t4[] = {k4}, *of_outputs[] = {y};
    const lanes *at_x[] = {x, u, b->p, b->p + C, b->h}, *at_t[] = {t, u, b->p, b->p + C, b->h};
    if (NS) {
        rates_of(at_x, of_x);
        for (int i = 0; i < NS; ++i) moved[i] = parts * part * k1[STEPWISE[i]];
    }
    for (int step = 0; step < parts; ++step) {
        rates_of(at_x, of_x);
        for (int i = 0; i < NS; ++i) k1[STEPWISE[i]] = NUMBER(0.0);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + part / 2 * k1[i];
        rates_of(at_t, of_t2);
        for (int i = 0; i < NS; ++i) k2[STEPWISE[i]] = NUMBER(0.0);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + part / 2 * k2[i];
        rates_of(at_t, of_t3);
        for (int i = 0; i < NS; ++i) k3[STEPWISE[i]] = NUMBER(0.0);
        for (int i = 0; i < NX; ++i) t[i] = x[i] + part * k3[i];
        rates_of(at_t, of_t4);
        for (int i = 0; i < NS; ++i) k4[STEPWISE[i]] = NUMBER(0.0);
        for (int i = 0; i < NX; ++i) x[i] += part / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
    for (int i = 0; i < NS; ++i) x[STEPWISE[i]] += moved[i];
    for (int i = 0; i < NX; ++i) rest += x[i] - x[i]; /* 0, but NaN where a state is not finite */
    for (int lane = 0; lane < LANES; ++lane)
        if (rest[lane] != 0) return 0;
    outputs_of(at_x, of_outputs);
    for (int lane = 0; lane < LANES; ++lane) {
        double *z = s[lane]->z;
        for (int i = 0; i < NX; ++i) z[X + i] = x[i][lane];
        for (int i = 0; i < NY; ++i) z[Y + i] = y[i][lane];
    }
    return 1;
}

#define FOR_REGISTERS(name)                                                                                            \
    __attribute__((target(#name))) static void rates_##name(const lanes **arg, lanes **res) {                          \
        derivatives_lanes(arg, res);                                                                                   \
    }                                                                                                                  \
    __attribute__((target(#name))) static void outputs_##name(const lanes **arg, lanes **res) {                        \
        outputs_lanes(arg, res);                                                                                       \
    }                                                                                                                  \
    __attribute__((target(#name))) static int step_##name(struct instance *const *s, const struct beside *b) {         \
        return step_lanes(s, b, rates_##name, outputs_##name);                                                         \
    }
FOR_REGISTERS(avx512f)
FOR_REGISTERS(avx2)

typedef int (*side_by_side)(struct instance *const *, const struct beside *);

/* NULL without wide registers. */
static side_by_side step_of_widest(void) {
    static const side_by_side STEP[] = {[NARROW] = NULL, [AVX2] = step_avx2, [AVX512F] = step_avx512f};
    return STEP[widest()];
}

/* Whether an instance can step beside the first: its next step is as its last one was, with the same parameters, which
   take back its step size where they change, and of as many parts. */
static int is_ready(const struct instance *s, const struct instance *first, double step_size) {
    return s->phase == STEPPING && !s->failed && s->step_size == step_size && s->parts == first->parts;
}

static int step_block(struct instance *const *s, size_t n, double time, double step_size, side_by_side step) {
    enum { FEWEST = 3 }; /* that are sooner side by side */
    struct instance *block[LANES];
    if (!step || n < FEWEST) return 0;
    for (size_t k = 0; k < n; ++k)
        if (!is_ready(s[k], s[0], step_size)) return 0;
    for (size_t k = 0; k < LANES; ++k) block[k] = s[k < n ? k : n - 1]; /* the last one fills what is left */
    const struct beside *parameters = parameters_of(block);
    if (!parameters || !step(block, parameters)) return 0;
    for (size_t k = 0; k < n; ++k) s[k]->stale = 0, s[k]->time = time + step_size;
    return 1;
}
#else
enum { LANES = 1 };
typedef void *side_by_side;
static side_by_side step_of_widest(void) { return NULL; }
static int step_block(struct instance *const *s, size_t n, double time, double step_size, side_by_side step) {
    return (void)s, (void)n, (void)time, (void)step_size, (void)step, 0;
}
#endif

/* fmi2DoStep of n instances of this library, with the status of each; an extension of FMI. The highest status. */
EXPORT int gfor_step_stack(struct instance *const *s, size_t n, double time, double step_size, int *status) {
    static side_by_side known;
    static int looked;
    int worst = OK;
    if (!looked) known = step_of_widest(), looked = 1;
    for (size_t first = 0; first < n; first += LANES) {
        const size_t last = first + LANES < n ? first + LANES : n;
        const int done = step_block(s + first, last - first, time, step_size, known);
        for (size_t k = first; k < last; ++k) {
            status[k] = done ? OK : fmi2DoStep(s[k], time, step_size, 1);
            worst = status[k] > worst ? status[k] : worst;
        }
    }
    return worst;
}
