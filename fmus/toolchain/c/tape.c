/* Kernels of all models as one library: a model's functions are data, a tape. The same operations as in compiled code, in
   an order in which many equal ones follow each other; what follows from p and c alone is evaluated when these change.
   Nothing is shared between instances but the tape itself, which nobody changes. */
#include "tape.h"

#define KERNEL static

/* -- sections -------------------------------------------------------------------------------------------------------- */

#define RUN(code, takes, value)                                                                                        \
    case code:                                                                                                         \
        for (; n >= 4; n -= 4) {                                                                                       \
            STEP(takes, value)                                                                                         \
            STEP(takes, value)                                                                                         \
            STEP(takes, value)                                                                                         \
            STEP(takes, value)                                                                                         \
        }                                                                                                              \
        for (; n > 0; --n) STEP(takes, value)                                                                          \
        break;
#define STEP(takes, value)                                                                                             \
    {                                                                                                                  \
        const double a = slot[at[0]], b = slot[at[takes > 1]], c = slot[at[takes > 2 ? 2 : 0]],                        \
                     d = slot[at[takes > 3 ? 3 : 0]];                                                                  \
        (void)b, (void)c, (void)d;                                                                                     \
        at += takes;                                                                                                   \
        KEEP(value);                                                                                                   \
    }
enum { CODES = 34, LARGEST = 1 << 27 };
/* By code. Two operations of one code have two roundings, as they had apart: there is no contraction. */
static const char TAKES[CODES] = {2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 1,
                                  1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 3, 3, 3, 4, 4};

#define OPERATIONS                                                                                                     \
    RUN(0, 2, a + b)                                                                                                   \
    RUN(1, 2, a - b)                                                                                                   \
    RUN(2, 2, a * b)                                                                                                   \
    RUN(3, 2, a / b)                                                                                                   \
    RUN(4, 2, pow(a, b))                                                                                               \
    RUN(5, 2, atan2(a, b))                                                                                             \
    RUN(6, 2, copysign(a, b))                                                                                          \
    RUN(7, 2, fmin(a, b))                                                                                              \
    RUN(8, 2, fmax(a, b))                                                                                              \
    RUN(9, 2, a < b)                                                                                                   \
    RUN(10, 2, a <= b)                                                                                                 \
    RUN(11, 2, a == b)                                                                                                 \
    RUN(12, 2, a != b)                                                                                                 \
    RUN(13, 2, a && b)                                                                                                 \
    RUN(14, 2, a || b)                                                                                                 \
    RUN(15, 2, a ? b : 0)                                                                                              \
    RUN(16, 1, -a)                                                                                                     \
    RUN(17, 1, 1. / a)                                                                                                 \
    RUN(18, 1, a * a)                                                                                                  \
    RUN(19, 1, 2. * a)                                                                                                 \
    RUN(20, 1, sqrt(a))                                                                                                \
    RUN(21, 1, sin(a))                                                                                                 \
    RUN(22, 1, cos(a))                                                                                                 \
    RUN(23, 1, tan(a))                                                                                                 \
    RUN(24, 1, exp(a))                                                                                                 \
    RUN(25, 1, log(a))                                                                                                 \
    RUN(26, 1, fabs(a))                                                                                                \
    RUN(27, 1, floor(a))                                                                                               \
    RUN(28, 1, !a)                                                                                                     \
    RUN(29, 3, a * b + c)                                                                                              \
    RUN(30, 3, a * b - c)                                                                                              \
    RUN(31, 3, c - a * b)                                                                                              \
    RUN(32, 4, a * b + c * d)                                                                                          \
    RUN(33, 4, a * b - c * d)

/* Execute a section on the slots; what it computes lies from `out` on. A value may be used in its own run. */
static void execute(double *w, int which, double *out) {
    const uint32_t *run = OF(w)->run[which], *end = run + 2 * OF(w)->size.section[which].runs;
    const uint32_t *at = OF(w)->operand[which];
    const double *slot = SLOT;
#define KEEP(value) *out++ = value
    for (; run < end; run += 2) {
        int n = (int)run[1];
        switch (run[0]) { OPERATIONS }
    }
#undef KEEP
}

/* Execute what the currents that a state moves need. */
static void execute_moved(double *w) {
    const int32_t *run = OF(w)->reach.run, *end = run + 2 * OF(w)->reach.runs, *place = OF(w)->reach.place;
    const uint32_t *at = OF(w)->reach.operand;
    double *slot = SLOT;
#define KEEP(value) slot[*place++] = value
    for (; run < end; run += 2) {
        int n = run[1];
        switch (run[0]) { OPERATIONS }
    }
#undef KEEP
}

/* The first n results of a section from number `first` on, which was executed. */
static void take(const double *w, int which, int first, int n, double *value) {
    const uint32_t *result = OF(w)->result[which] + first;
    for (int k = 0; k < n; ++k) value[k] = SLOT[result[k]];
}

static void evaluate(double *w, int which, double *value) {
    execute(w, which, SLOT + AT_FIXED + OF(w)->size.fixed);
    take(w, which, 0, OF(w)->size.section[which].results, value);
}

/* Put n numbers into the slots from `first` on. Voltages are no longer those at the slots if one of them differs. Bytes
   are compared: a NaN is equal to itself, -0.0 not to 0.0. */
static void fill(double *w, int first, const double *value, int n) {
    if (!memcmp(SLOT + first, value, n * sizeof *value)) return;
    memcpy(SLOT + first, value, n * sizeof *value);
    OF(w)->settled = NOTHING;
    if (first != X) OF(w)->swept = NOTHING;
    if (OF(w)->swept == ALL) OF(w)->swept = BUT_STATES;
}

/* Parameters, what they fix, and inputs in their slots. */
static void enter(const double *z, double *w) {
    if (!OF(w)->known || memcmp(SLOT, z, U * sizeof *z)) {
        memcpy(SLOT, z, U * sizeof *z);
        execute(w, FIXED, SLOT + AT_FIXED);
        OF(w)->known = 1;
        OF(w)->swept = OF(w)->settled = NOTHING;
        OF(w)->made_of_parameters = 0;
    }
    fill(w, U, z + U, NU);
}

#include "reach.c"
#include "nodal.c"

/* A function of states, at the voltages that these give. Outputs and rates are often asked for at one point, and outputs
   again by a step of a network without states: its voltages are found once. */
static void at_states(double *w, int which, const double *x, double *value) {
    if (!OF(w)->size.section[which].results) return; /* most phasor networks have no states */
    fill(w, X, x, NX);
    if (NB) settle_voltages(w, which == DERIVATIVES ? WANTED : ALL);
    evaluate(w, which, value);
}

static void rates(const double *z, const double *x, double *rate, double *w) {
    (void)z;
    at_states(w, DERIVATIVES, x, rate);
}

static int finish(double *z, double *w) {
    for (int i = 0; i < NX; ++i)
        if (!isfinite(z[X + i])) return i + 1;
    if (!OF(w)->outputs_when_read) at_states(w, OUTPUTS, z + X, z + Y);
    return 0;
}

static void matrix(const double *z, double gh, double *m, double *w) {
    (void)z;
    SLOT[AT_GH] = gh;
    evaluate(w, MATRIX, m);
}

#define advance advance_explicitly
#include "runge_kutta.c"
#undef advance
#define advance advance_implicitly
#include "sdirk.c"
#undef advance

/* -- a tape in memory ------------------------------------------------------------------------------------------------ */

static uint32_t crc32(const unsigned char *at, size_t n) {
    uint32_t table[256], crc = 0xffffffffu;
    for (uint32_t k = 0; k < 256; ++k) {
        table[k] = k;
        for (int bit = 0; bit < 8; ++bit) table[k] = (table[k] >> 1) ^ (table[k] & 1 ? 0xedb88320u : 0);
    }
    while (n--) crc = table[(crc ^ *at++) & 255] ^ (crc >> 8);
    return ~crc;
}

/* Point at the lists of a tape; returns the bytes that they take, all together. */
static int64_t lay_out(const struct header *tape, struct tape *t) {
    t->size = tape->size;
    t->largest_rest = tape->largest_rest;
    const int32_t *at = (const int32_t *)((const double *)(tape + 1) + t->size.numbers);
    const int64_t rank = t->size.rank, lengths[] = {t->size.held, t->size.given, rank, rank + 1, t->size.nlu, rank,
                                                    rank + 1, t->size.nm};
    const int32_t **lists[] = {&t->stepwise, &t->given_at, &t->perm, &t->row, &t->col, &t->diag, &t->mrow, &t->mcol};
    int64_t words = 0;
    for (int k = 0; k < 8; ++k) {
        *lists[k] = at + words;
        words += lengths[k];
    }
    for (int k = 0; k < SECTIONS; ++k) {
        t->run[k] = (const uint32_t *)at + words;
        words += 2 * (int64_t)t->size.section[k].runs;
        t->result[k] = (const uint32_t *)at + words;
        words += t->size.section[k].results;
        t->operand[k] = (const uint32_t *)at + words;
        words += t->size.section[k].operands;
    }
    return (int64_t)sizeof *tape + 8 * (int64_t)t->size.numbers + 4 * words;
}

static int all_below(const int32_t *list, int64_t n, int64_t limit) {
    for (int64_t k = 0; k < n; ++k)
        if (list[k] < 0 || list[k] >= limit) return 0;
    return 1;
}

/* Rows of a matrix: each begins where the one before ends. */
static int is_rising(const int32_t *row, int n, int end) {
    if (row[0] || row[n] != end) return 0;
    for (int i = 0; i < n; ++i)
        if (row[i] > row[i + 1]) return 0;
    return 1;
}

/* Every operand of a section was computed before, and every result is a slot. */
static int is_sound(double *w, int which) {
    const struct section s = OF(w)->size.section[which];
    const int fixed = AT_FIXED + OF(w)->size.fixed;
    int64_t at = which == FIXED ? AT_FIXED : fixed, last = which == FIXED ? fixed : OF(w)->size.slots, used = 0;
    for (int k = 0; k < s.runs; ++k) {
        const uint32_t code = OF(w)->run[which][2 * k], n = OF(w)->run[which][2 * k + 1];
        const int taken = code < CODES ? TAKES[code] : 0;
        if (!taken || at + n > last || used + (int64_t)taken * n > s.operands) return 0;
        for (uint32_t j = 0; j < n; ++j, ++at)
            for (int side = 0; side < taken; ++side)
                if (OF(w)->operand[which][used++] >= at) return 0;
    }
    if (used != s.operands || (which == FIXED && at != last)) return 0;
    for (int k = 0; k < s.results; ++k)
        if (OF(w)->result[which][k] >= at) return 0;
    return 1;
}

/* Why a tape cannot be executed for a model with so many variables and rules; NULL if it can. */
TAPE const char *tape_fault(const void *bytes, size_t size, int variables, int rules) {
    const struct header *tape = bytes;
    if (size < sizeof *tape || memcmp(tape->magic, "gfortape", 8)) return "it is no tape";
    if (tape->version != VERSION) return "it is of another version";
    if (tape->bytes != size) return "it is not whole";
    if (tape->checksum != crc32((const unsigned char *)&tape->largest_rest, size - offsetof(struct header, largest_rest)))
        return "its checksum differs";
    const int32_t *sizes = (const int32_t *)&tape->size;
    for (size_t k = 0; k < sizeof tape->size / sizeof *sizes; ++k)
        if (sizes[k] < 0 || sizes[k] > LARGEST) return "a size is wrong";
    struct tape t = {0};
    double *w = (double *)&t;
    if (lay_out(tape, &t) != (int64_t)size) return "its sizes do not add up";
    const struct sizes *s = &t.size;
    const int wanted[SECTIONS] = {0, NC + NX, s->section[REQUIREMENTS].results, NY, NX, NB ? 2 * NM : NM, 2 * NB};
    if (NX + (int64_t)DX != variables || wanted[REQUIREMENTS] != rules) return "it is of another model";
    const int64_t filled = (int64_t)AT_FIXED + s->fixed;
    if (filled > s->slots || s->rank != (s->implicit ? NX : NB) || (s->implicit && NB)) return "its sizes do not agree";
    for (int k = 0; k < SECTIONS; ++k)
        if (s->section[k].results != wanted[k] || !is_sound(w, k)) return "an operation is wrong";
    if (!all_below(STEPWISE, NS, NX) || !all_below(GIVEN, NG, NU) || !all_below(PERM, s->rank, s->rank) ||
        !all_below(COL, NLU, s->rank) || !all_below(MCOL, NM, s->rank) || !is_rising(ROW, s->rank, NLU) ||
        !is_rising(MROW, s->rank, NM))
        return "a list is wrong";
    for (int i = 0; i < s->rank; ++i)
        if (DIAG[i] < ROW[i] || DIAG[i] >= ROW[i + 1]) return "a pivot is wrong";
    return NULL;
}

/* -- kernel ---------------------------------------------------------------------------------------------------------- */

/* Numbers that an instance needs of its own, for a tape without a fault. */
TAPE int64_t workspace_size(const void *tape) {
    struct tape t;
    double *w = (double *)&t;
    lay_out(tape, &t);
    return OWN + (NB ? NODAL_SIZE : t.size.implicit ? IMPLICIT_SIZE : 0);
}

/* Make a workspace ready; the tape stays where it is until the last call. */
TAPE void begin(const void *tape, double *w) {
    memset(w, 0, (size_t)workspace_size(tape) * sizeof *w);
    lay_out(tape, OF(w));
    OF(w)->wide = widest() >= AVX2;
    if (NB) place_reach(w, (int32_t *)(w + REACH)), find_reach(w);
    memcpy(SLOT + AT_GH + 1, (const struct header *)tape + 1, OF(w)->size.numbers * sizeof *w);
}

TAPE void initialise(double *z, double *w) {
    OF(w)->known = 0;
    memcpy(SLOT, z, NP * sizeof *z);
    execute(w, INITIALISE, SLOT + AT_FIXED + OF(w)->size.fixed);
    take(w, INITIALISE, 0, NC, z + C);
    take(w, INITIALISE, NC, NX, z + X);
}

TAPE void outputs(double *z, double *w) {
    enter(z, w);
    at_states(w, OUTPUTS, z + X, z + Y);
}

TAPE void derivatives(double *z, double *w) {
    enter(z, w);
    at_states(w, DERIVATIVES, z + X, z + DX);
}

/* Values at z, where no output has to be computed for them: a network's voltages are there once they are found, and
   most of its time goes into thousands of flows. 1; 0 where an output is asked for that has to be computed. */
TAPE int glance(double *z, double *w, const unsigned *reference, size_t n, double *value) {
    const uint32_t *result = OF(w)->result[OUTPUTS], computed = (uint32_t)(AT_FIXED + OF(w)->size.fixed);
    const unsigned first = (unsigned)Y, end = (unsigned)DX;
    int rates_wanted = 0, voltages_wanted = 0;
    if (!NB) return 0;
    for (size_t k = 0; k < n; ++k) {
        rates_wanted |= reference[k] >= end;
        voltages_wanted |= reference[k] >= first;
        if (reference[k] >= first && reference[k] < end && result[reference[k] - first] >= computed) return 0;
    }
    enter(z, w);
    fill(w, X, z + X, NX);
    if (voltages_wanted) settle_voltages(w, ALL);
    if (rates_wanted) evaluate(w, DERIVATIVES, z + DX);
    for (size_t k = 0; k < n; ++k) {
        const int is_output = reference[k] >= first && reference[k] < end;
        value[k] = is_output ? SLOT[result[reference[k] - first]] : z[reference[k]];
    }
    return 1;
}

TAPE void requirements(const double *z, double *w, double *margins) {
    enter(z, w);
    evaluate(w, REQUIREMENTS, margins);
}

TAPE int advance(double *z, double h, int n, double *w) {
    return OF(w)->size.implicit ? advance_implicitly(z, h, n, w) : advance_explicitly(z, h, n, w);
}
