/* Answers of one FMU to moves: each variable is set to a value by itself, what follows is read, and all is put back: the
   whole state after a step, else the variable. `answers_to_moves.py` calls it. */
#include "fmi.h"

typedef int (*put_back)(void *, void *);

struct batch { /* variables that are read together, a row for each move */
    const unsigned *references;
    int64_t count;
    double *rows;
};

struct moves {
    void *component;
    get_set set_real, get_real;
    do_step step;
    put_back set_state;
    void *saved;
    double time, step_size;
    struct batch before[2], after;
    const unsigned *references; /* of all variables */
    const int64_t *places;      /* of the moved one among them, by move */
    double *values;             /* to which it is moved */
    double *rest;               /* what it is at rest */
    const uint8_t *steps;       /* whether a step follows */
};

enum { CALLED_SET = 1, CALLED_GET, CALLED_STEP, CALLED_PUT_BACK };

static int read_row(const struct moves *m, const struct batch *b, int64_t move) {
    return b->count ? m->get_real(m->component, b->references, (size_t)b->count, b->rows + move * b->count) : 0;
}

static int answer(const struct moves *m, int64_t k, int *called) {
    int status = m->set_real(m->component, m->references + m->places[k], 1, m->values + k);
    *called = CALLED_SET;
    for (int i = 0; i < 2 && status <= 1; ++i) {
        status = read_row(m, &m->before[i], k);
        *called = CALLED_GET;
    }
    if (status > 1) return status;
    if (!m->steps[k]) {
        *called = CALLED_SET;
        return m->set_real(m->component, m->references + m->places[k], 1, m->rest + k);
    }
    status = m->step(m->component, m->time, m->step_size, 1);
    *called = CALLED_STEP;
    if (status > 1) return status;
    status = read_row(m, &m->after, k);
    *called = CALLED_GET;
    if (status > 1) return status;
    *called = CALLED_PUT_BACK;
    return m->set_state(m->component, m->saved);
}

/* Moves from number `first` on. 0, or the status of the first call that is neither OK nor Warning, and which it was. */
EXPORT int answers_to_moves(const struct moves *m, int64_t first, int64_t count, int *called) {
    for (int64_t k = first; k < first + count; ++k) {
        const int status = answer(m, k, called);
        if (status > 1) return status;
    }
    return 0;
}
