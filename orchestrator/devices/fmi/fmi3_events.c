/* Events of an FMU of FMI 3.0 between two communication points of a master that knows none: early returns, Event Mode, and
   clocks that tick by the time. A step is split where something happens, and ends with all that happens at its end. */

enum { VAIN = 1000 }; /* event iterations, or early returns, that get no further */

static double near(double time) { return 1e-12 * (1 + fabs(time)); }

static const struct special *special_of(const struct instance *s, unsigned reference, struct cell **cell) {
    for (size_t low = 0, high = s->fmu.n_specials; low < high;) {
        const size_t middle = (low + high) / 2;
        const struct special *found = s->fmu.specials + middle;
        if (found->reference == reference) {
            *cell = s->cells + middle;
            return found;
        }
        if (found->reference < reference)
            low = middle + 1;
        else
            high = middle;
    }
    return NULL;
}

static void begin(struct instance *s) {
    s->course = (struct course){.next_event = INFINITY};
    for (size_t k = 0; k < s->fmu.n_clocks; ++k) s->paces[k] = (struct pace){.next = INFINITY};
    for (size_t k = 0; k < s->fmu.n_specials; ++k) s->cells[k] = (struct cell){.value = s->fmu.specials[k].start};
}

/* While it is initialised: when each clock ticks first. */
static int first_ticks(struct instance *s) {
    for (size_t k = 0; k < s->fmu.n_clocks; ++k) {
        const struct clock *c = s->fmu.clocks + k;
        struct pace *p = s->paces + k;
        double interval = c->interval, shift = c->shift;
        int qualifier = 2;
        if (c->kind == OUTPUT) continue;
        if (c->asked) {
            MUST(s->fmu.get_interval(s->inner, &c->reference, 1, &interval, &qualifier));
            if (c->kind == PERIODIC) MUST(s->fmu.get_shift(s->inner, &c->reference, 1, &shift));
        }
        if (c->kind == COUNTDOWN && !qualifier) continue;
        if (!(interval >= 0) || !(shift >= 0) || (c->kind == PERIODIC && !(interval > 0)))
            return say(s, ERROR, "a clock (value reference %u) has an interval of %g s and a shift of %g s", c->reference, interval, shift);
        *p = (struct pace){.base = s->start + (c->kind == PERIODIC ? shift : interval), .interval = interval};
        p->next = p->base;
    }
    return OK;
}

/* Have the clocks of `ticking` tick: what waited for them is set, and what they compute is read while it is there. */
static int tick(struct instance *s, uint64_t ticking) {
    static const bool active = true;
    for (size_t k = 0; k < s->fmu.n_clocks; ++k) {
        const struct clock *c = s->fmu.clocks + k;
        struct pace *p = s->paces + k;
        if (!(ticking >> k & 1)) continue;
        MUST(s->fmu.set_clock(s->inner, &c->reference, 1, &active));
        if (c->kind == PERIODIC)
            ++p->ticks, p->next = p->base + (double)p->ticks * p->interval;
        else
            p->next = INFINITY;
    }
    for (size_t k = 0; k < s->fmu.n_specials; ++k) {
        const struct special *v = s->fmu.specials + k;
        if (v->role != CLOCKED_INPUT || !(v->clocks & ticking) || !s->cells[k].known) continue;
        union any value = typed(v->kind, s->cells[k].value);
        MUST(s->fmu.set[v->kind](s->inner, &v->reference, 1, &value, 1));
    }
    for (size_t k = 0; k < s->fmu.n_clocks; ++k) {
        const struct clock *c = s->fmu.clocks + k;
        bool on = false;
        if (c->kind != OUTPUT || !s->fmu.get_clock) continue;
        MUST(s->fmu.get_clock(s->inner, &c->reference, 1, &on));
        if (on) ticking |= (uint64_t)1 << k;
    }
    for (size_t k = 0; k < s->fmu.n_specials; ++k) {
        const struct special *v = s->fmu.specials + k;
        union any value = {0};
        if (v->role != CLOCKED || !(v->clocks & ticking)) continue;
        MUST(s->fmu.get[v->kind](s->inner, &v->reference, 1, &value, 1));
        s->cells[k].value = number(v->kind, &value);
    }
    return OK;
}

/* After an event: the new intervals of clocks that do not know them in advance. */
static int new_intervals(struct instance *s, uint64_t ticked) {
    for (size_t k = 0; k < s->fmu.n_clocks; ++k) {
        const struct clock *c = s->fmu.clocks + k;
        struct pace *p = s->paces + k;
        const bool changes = c->kind == CHANGING && (ticked >> k & 1);
        double interval = 0;
        int qualifier = 0;
        if (!changes && c->kind != COUNTDOWN && !(c->tunable && c->asked)) continue;
        MUST(s->fmu.get_interval(s->inner, &c->reference, 1, &interval, &qualifier));
        if (qualifier != 2 && !(changes && qualifier == 1)) continue;
        if (!(interval >= 0) || (c->kind == PERIODIC && !(interval > 0)))
            return say(s, ERROR, "a clock (value reference %u) has an interval of %g s at t = %g s", c->reference, interval, s->course.now);
        *p = (struct pace){.base = s->course.now + interval, .interval = interval, .next = s->course.now + interval};
    }
    return OK;
}

static uint64_t due(const struct instance *s, double margin) {
    uint64_t ticking = 0;
    for (size_t k = 0; k < s->fmu.n_clocks; ++k)
        if (s->paces[k].next <= s->course.now + margin) ticking |= (uint64_t)1 << k;
    return ticking;
}

static int open_event(struct instance *s) {
    if (!s->course.open) MUST(s->fmu.enter_event_mode(s->inner));
    s->course.open = 1;
    return OK;
}

/* In Event Mode: all that happens now, until nothing more does; then back to Step Mode. */
static int close_event(struct instance *s, double margin) {
    struct course *c = &s->course;
    if (!c->open) return OK;
    for (int round = 0; round < VAIN; ++round) {
        bool again = false, stop = false, nominals = false, states = false, timed = false;
        double when = INFINITY;
        const uint64_t ticking = due(s, margin);
        MUST(tick(s, ticking));
        MUST(s->fmu.update_discrete_states(s->inner, &again, &stop, &nominals, &states, &timed, &when));
        if (stop) {
            c->ended = 1, c->reached = c->now;
            return DISCARD;
        }
        c->next_event = timed && when >= c->now - margin ? when : INFINITY;
        MUST(new_intervals(s, ticking));
        if (again || due(s, margin) || c->next_event <= c->now + margin) continue;
        c->open = 0;
        return s->fmu.enter_step_mode(s->inner);
    }
    return say(s, ERROR, "the events at t = %g s do not come to an end", c->now);
}

static int settle(struct instance *s) { return s->course.open ? close_event(s, near(s->course.now)) : OK; }

/* When the next event is that is known in advance. */
static double upcoming(const struct instance *s) {
    double time = s->course.next_event;
    for (size_t k = 0; k < s->fmu.n_clocks; ++k)
        if (s->paces[k].next < time) time = s->paces[k].next;
    return time;
}

/* One communication step, with all events on the way and at its end. */
static int step_with_events(struct instance *s, double time, double step, bool no_return) {
    struct course *c = &s->course;
    const double target = time + step, margin = 1e-6 * step + near(target);
    int vain = 0;
    c->now = time;
    MUST(s->course.open ? close_event(s, margin) : OK);
    for (;;) {
        const double event_time = s->fmu.events ? upcoming(s) : INFINITY, from = c->now;
        const double until = event_time < target - margin ? event_time : target;
        bool event = false, stop = false, early = false;
        double reached = until;
        if (until - from > margin) {
            const double length = from == time && until == target ? step : until - from; /* to the last bit */
            MUST(s->fmu.do_step(s->inner, from, length, no_return, &event, &stop, &early, &reached));
            if (early && !s->fmu.early)
                return say(s, ERROR, "the FMU returned early from its step, at t = %g s, which it was not allowed to", reached);
            if (event && !s->fmu.events)
                return say(s, ERROR, "the FMU asks to handle an event at t = %g s, but has no event mode", reached);
            if (stop) {
                c->ended = 1, c->reached = reached;
                return DISCARD;
            }
            if (early && !(reached >= from - margin && reached <= until + margin))
                return say(s, ERROR, "the FMU returned at t = %g s from a step of %g to %g s", reached, from, until);
            vain = reached > from + margin ? 0 : vain + 1;
            if (vain > VAIN) return say(s, ERROR, "the FMU returns early again and again at t = %g s", reached);
            c->now = early && reached < until - margin ? reached : until;
        } else {
            c->now = until;
        }
        if (s->fmu.events && (event || due(s, margin) || c->next_event <= c->now + margin)) {
            MUST(open_event(s));
            MUST(close_event(s, margin));
        }
        if (c->now >= target - margin) break;
    }
    c->now = target;
    return OK;
}

/* -- variables that are not there at any time ---------------------------------------------------- */

/* Whether a variable is there only while its clock ticks; then its value is the one that was read or given last. */
static bool held(struct instance *s, unsigned reference, double *x) {
    struct cell *cell;
    const struct special *v = special_of(s, reference, &cell);
    if (!v || v->role == DISCRETE_INPUT) return false;
    *x = cell->value;
    return true;
}

/* Before a variable is set: what belongs to a clock waits for it (then *waits), and a discrete input that changes while the
   FMU runs is an event. */
static int before_setting(struct instance *s, unsigned reference, double x, bool *waits) {
    struct cell *cell;
    const struct special *v = special_of(s, reference, &cell);
    *waits = v && v->role == CLOCKED_INPUT;
    if (!v || v->role == CLOCKED) return OK;
    if (v->role == DISCRETE_INPUT && s->course.running) {
        *waits = cell->known && cell->value == x; /* it is what it was */
        if (!*waits) MUST(open_event(s));
    }
    cell->value = x, cell->known = 1;
    return OK;
}

/* -- state: the FMU's own, and the adapter's beside it ------------------------------------------- */

struct saved {
    void *inner;
    struct course course; /* then the paces and the cells */
};

static bool plain(const struct instance *s) { return !s->fmu.events && !s->fmu.early; }

static size_t beside(const struct instance *s) {
    return sizeof(struct course) + s->fmu.n_clocks * sizeof(struct pace) + s->fmu.n_specials * sizeof(struct cell);
}

static void pack(const struct instance *s, void *bytes) {
    unsigned char *at = bytes;
    memcpy(at, &s->course, sizeof s->course), at += sizeof s->course;
    memcpy(at, s->paces, s->fmu.n_clocks * sizeof *s->paces), at += s->fmu.n_clocks * sizeof *s->paces;
    memcpy(at, s->cells, s->fmu.n_specials * sizeof *s->cells);
}

static void unpack(struct instance *s, const void *bytes) {
    const unsigned char *at = bytes;
    memcpy(&s->course, at, sizeof s->course), at += sizeof s->course;
    memcpy(s->paces, at, s->fmu.n_clocks * sizeof *s->paces), at += s->fmu.n_clocks * sizeof *s->paces;
    memcpy(s->cells, at, s->fmu.n_specials * sizeof *s->cells);
}

static int save(struct instance *s, void **state) {
    MUST(settle(s));
    struct saved *kept = *state ? *state : calloc(1, sizeof(void *) + beside(s));
    if (!kept) return say(s, ERROR, "no memory for a state");
    const int status = s->fmu.get_state(s->inner, &kept->inner);
    if (status > WARNING) {
        if (!*state) free(kept);
        return status;
    }
    pack(s, &kept->course);
    *state = kept;
    return status;
}

static int restore(struct instance *s, struct saved *kept) {
    MUST(settle(s));
    MUST(s->fmu.set_state(s->inner, kept->inner));
    unpack(s, &kept->course);
    return OK;
}

static int discard(struct instance *s, void **state) {
    struct saved *kept = *state;
    const int status = kept ? s->fmu.free_state(s->inner, &kept->inner) : OK;
    free(kept);
    *state = NULL;
    return status;
}

static int serialize(struct instance *s, struct saved *kept, unsigned char *bytes, size_t size) {
    const size_t own = beside(s);
    if (size < own) return say(s, ERROR, "a state needs more than %zu bytes", size);
    memcpy(bytes, &kept->course, own);
    return s->fmu.serialize(s->inner, kept->inner, bytes + own, size - own);
}

static int deserialize(struct instance *s, const unsigned char *bytes, size_t size, void **state) {
    const size_t own = beside(s);
    struct saved *kept = *state ? *state : calloc(1, sizeof(void *) + own);
    if (!kept || size < own) {
        if (!*state) free(kept);
        return say(s, ERROR, "a state of %zu bytes cannot be read", size);
    }
    memcpy(&kept->course, bytes, own);
    *state = kept;
    return s->fmu.deserialize(s->inner, bytes + own, size - own, &kept->inner);
}
