/* Threads that do the items of one round side by side: each has a share of its own and then takes what others have not
   begun, so that nobody waits for a thread that sleeps. Whoever calls is one of them. Compiled in front of
   `inner_loop.c`; `team.py` starts the threads.

   A round gives the same numbers whoever does which item: items of a round read nothing that another one writes. */
#include <fenv.h>

#include "clock.h"
#include "fmi.h"
#include "waiting.h"

enum { MOST_MEMBERS = 64, LINE = 128, VAIN = 4, LATER = 100 };

/* How long a thread looks for the next round before it sleeps [s]: the others' share of a step, such as a grid's, is
   shorter as a rule. Where it is not, a thread gives up looking for some rounds. */
static const double AWAKE = 100e-6;

struct share {
    _Alignas(LINE) uint64_t left; /* the round in the upper half, in the lower one how many items nobody has taken */
    const int64_t *items;
};

struct team {
    int32_t round; /* the newest one */
    int32_t ending, members, settings; /* settings: number of the newest `arithmetic` */
    void (*task)(void *, int64_t);
    void *context;
    void *(*unlock)(void); /* give Python's lock away while there is nothing to do, and take it back */
    void (*lock)(void *);
    fenv_t arithmetic; /* rounding, and what becomes of the smallest numbers, as the caller has it */
    _Alignas(LINE) int32_t done; /* items of this round that the others have finished */
    int32_t waiting;
    _Alignas(LINE) int32_t sleeping;
    struct share shares[MOST_MEMBERS];
};

EXPORT size_t team_size(void) { return sizeof(struct team); }

EXPORT void team_form(struct team *t, int64_t members, void *(*unlock)(void), void (*lock)(void *)) {
    t->members = (int32_t)members, t->unlock = unlock, t->lock = lock;
}

/* Take an item of a round, if there is one left. */
static int take(struct share *s, uint32_t round, int64_t *item) {
    uint64_t left = __atomic_load_n(&s->left, __ATOMIC_ACQUIRE);
    while ((uint32_t)(left >> 32) == round && (uint32_t)left)
        if (__atomic_compare_exchange_n(&s->left, &left, left - 1, 1, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) {
            *item = s->items[(uint32_t)left - 1]; /* the round goes on until this item is done */
            return 1;
        }
    return 0;
}

/* Do what is left of a round, the own share first; how many items that were. */
static int32_t work_through(struct team *t, int32_t self, uint32_t round) {
    int32_t count = 0;
    for (int32_t k = 0; k < t->members; ++k) {
        int64_t item;
        while (take(&t->shares[(self + k) % t->members], round, &item)) t->task(t->context, item), ++count;
    }
    return count;
}

struct patience {
    int32_t vain, later;
};

static void await_round(struct team *t, int32_t old, struct patience *p) {
    if (p->later > 0) {
        --p->later;
    } else {
        const double until = seconds() + AWAKE;
        do {
            for (int k = 0; k < 16; ++k) {
                if (__atomic_load_n(&t->round, __ATOMIC_ACQUIRE) != old) {
                    p->vain = 0;
                    return;
                }
                relax();
            }
        } while (seconds() < until);
        if (++p->vain >= VAIN) p->vain = 0, p->later = LATER;
    }
    __atomic_fetch_add(&t->sleeping, 1, __ATOMIC_SEQ_CST);
    while (__atomic_load_n(&t->round, __ATOMIC_SEQ_CST) == old) rest(&t->round, old);
    __atomic_fetch_sub(&t->sleeping, 1, __ATOMIC_SEQ_CST);
}

/* What a thread of the team does until the team is dismissed. */
EXPORT void team_work(struct team *t, int64_t self, int64_t since) {
    struct patience patience = {0, 0};
    int32_t round = (int32_t)since, settings = 0;
    for (;;) {
        await_round(t, round, &patience);
        round = __atomic_load_n(&t->round, __ATOMIC_ACQUIRE);
        if (__atomic_load_n(&t->ending, __ATOMIC_ACQUIRE)) return;
        if (settings != t->settings) settings = t->settings, fesetenv(&t->arithmetic);
        const int32_t count = work_through(t, (int32_t)self, (uint32_t)round);
        if (!count) continue;
        __atomic_fetch_add(&t->done, count, __ATOMIC_SEQ_CST);
        if (__atomic_load_n(&t->waiting, __ATOMIC_SEQ_CST)) wake(&t->done);
    }
}

static void call_up(struct team *t, int32_t round) {
    __atomic_store_n(&t->round, round, __ATOMIC_SEQ_CST);
    if (__atomic_load_n(&t->sleeping, __ATOMIC_SEQ_CST)) wake(&t->round);
}

EXPORT int64_t team_round(const struct team *t) { return t->round; }

EXPORT void team_dismiss(struct team *t) {
    __atomic_store_n(&t->ending, 1, __ATOMIC_SEQ_CST);
    call_up(t, (int32_t)((uint32_t)t->round + 1));
}

/* From now on all compute as the caller does. */
static void team_agree(struct team *t, void (*task)(void *, int64_t), void *context) {
    fegetenv(&t->arithmetic);
    t->settings += 1, t->task = task, t->context = context;
}

/* A thread that logs waits for Python's lock, which the caller holds: after a while it is given away. */
static void await_others(struct team *t, int32_t wanted) {
    const double until = seconds() + AWAKE;
    do {
        for (int k = 0; k < 16; ++k) {
            if (__atomic_load_n(&t->done, __ATOMIC_ACQUIRE) == wanted) return;
            relax();
        }
    } while (seconds() < until);
    void *const python = t->unlock();
    __atomic_store_n(&t->waiting, 1, __ATOMIC_SEQ_CST);
    for (int32_t seen; (seen = __atomic_load_n(&t->done, __ATOMIC_SEQ_CST)) != wanted;) rest(&t->done, seen);
    __atomic_store_n(&t->waiting, 0, __ATOMIC_SEQ_CST);
    t->lock(python);
}

/* Do one round: `own` by the caller alone, `items` by all; those of thread k begin at begin[k]. */
static void team_do(struct team *t, const int64_t *own, int64_t n_own, const int64_t *items, const int64_t *begin) {
    const uint32_t round = (uint32_t)t->round + 1;
    int64_t total = 0;
    t->done = 0;
    for (int32_t k = 0; k < t->members; ++k) {
        const int64_t n = begin[k + 1] - begin[k];
        t->shares[k].items = items + begin[k];
        __atomic_store_n(&t->shares[k].left, (uint64_t)round << 32 | (uint64_t)n, __ATOMIC_RELEASE);
        total += n;
    }
    call_up(t, (int32_t)round);
    for (int64_t i = 0; i < n_own; ++i) t->task(t->context, own[i]);
    const int32_t mine = work_through(t, 0, round);
    await_others(t, (int32_t)total - mine);
}
