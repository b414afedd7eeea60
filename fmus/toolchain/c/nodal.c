/* Voltages v of a network from Y v = i, for tapes whose derivatives and outputs are given at known voltages: a sparse
   complex LU without pivoting. Its pattern (PERM, ROW, COL, DIAG, MROW, MCOL): rows in order of elimination, each with
   its columns ascending; MROW and MCOL hold the matrix itself. Y follows from parameters and from the inputs GIVEN; its
   factors are kept until one of these changes. */
#define MADE_OF OWN /* p, c and given inputs that the factors were made of, once there are any */
#define FACTORS (MADE_OF + 1 + NP + NC + NG)
#define INVERSE (FACTORS + 2 * NLU)
#define ELEMENTS (INVERSE + 2 * NB)
#define SOUGHT (ELEMENTS + 2 * NM)
#define CURRENT (SOUGHT + 2 * NB)
#define SWEPT (CURRENT + 2 * NB)
#define BEGUN (SWEPT + 2 * NB)
#define REACH (BEGUN + 2 * NB)
#define NODAL_SIZE (REACH + REACH_WORDS(*OF(w)) / 2 + 1 - OWN)

/* What Y follows from is as it was when it was factorised. A large network's parameters take as long to compare as its
   factors to read; they are compared once after they were entered. */
static int unchanged(double *w) {
    const double *made_of = w + MADE_OF + 1, *given = made_of + U;
    if (!w[MADE_OF]) return 0;
    if (!OF(w)->made_of_parameters && memcmp(made_of, SLOT, U * sizeof *w)) return 0;
    OF(w)->made_of_parameters = 1;
    for (int k = 0; k < NG; ++k)
        if (memcmp(given + k, SLOT + U + GIVEN[k], sizeof *w)) return 0;
    return 1;
}

#define IN_ROW static inline __attribute__((always_inline))

/* Take elements from `first` to before `last` of a row, times y, off what is left of a current, which goes to `rest`. */
IN_ROW void take_off(double *rest, double re, double im, const double *lu, const double *y, const int32_t *col, int first,
                     int last) {
    for (int q = first; q < last; ++q) {
        re -= lu[2 * q] * y[2 * col[q]] - lu[2 * q + 1] * y[2 * col[q] + 1];
        im -= lu[2 * q] * y[2 * col[q] + 1] + lu[2 * q + 1] * y[2 * col[q]];
    }
    rest[0] = re;
    rest[1] = im;
}

/* What is left of the current into a row after the rows above it. */
IN_ROW void sweep_row(const double *lu, const double *b, double *y, const struct tape *t, int i) {
    const int bus = t->perm[i];
    take_off(y + 2 * i, b[bus], b[t->size.buses + bus], lu, y, t->col, t->row[i], t->diag[i]);
}

/* The solution of a row from those of the rows below it. */
IN_ROW void solve_row(const double *lu, const double *inverse, const double *y, double *s, const struct tape *t,
                             int i) {
    const int32_t *col = t->col;
    double re = y[2 * i], im = y[2 * i + 1];
    for (int q = t->diag[i] + 1; q < t->row[i + 1]; ++q) {
        re -= lu[2 * q] * s[2 * col[q]] - lu[2 * q + 1] * s[2 * col[q] + 1];
        im -= lu[2 * q] * s[2 * col[q] + 1] + lu[2 * q + 1] * s[2 * col[q]];
    }
    s[2 * i] = re * inverse[2 * i] - im * inverse[2 * i + 1];
    s[2 * i + 1] = re * inverse[2 * i + 1] + im * inverse[2 * i];
}

/* All rows; and of those that states move, what no state does, which is kept for the stages that follow. */
IN_ROW void sweep_all(double *w) {
    const struct reach *r = &OF(w)->reach;
    const double *lu = w + FACTORS, *b = w + CURRENT;
    double *y = w + SWEPT, *begun = w + BEGUN;
    for (int i = 0; i < NB; ++i) sweep_row(lu, b, y, OF(w), i);
    for (int k = 0; k < r->n_down; ++k) {
        const int i = r->down[k], bus = PERM[i];
        take_off(begun + 2 * k, b[bus], b[NB + bus], lu, y, COL, ROW[i], r->from[k]);
    }
}

/* The rows that states move, from where they do. */
IN_ROW void sweep_moved_rows(double *w) {
    const struct reach *r = &OF(w)->reach;
    const double *lu = w + FACTORS, *b = w + CURRENT, *begun = w + BEGUN;
    double *y = w + SWEPT;
    for (int k = 0; k < r->n_down; ++k) {
        const int i = r->down[k], bus = PERM[i], whole = r->from[k] == ROW[i];
        const double re = whole ? b[bus] : begun[2 * k], im = whole ? b[NB + bus] : begun[2 * k + 1];
        take_off(y + 2 * i, re, im, lu, y, COL, r->from[k], DIAG[i]);
    }
}

IN_ROW void solve_all(double *w) {
    for (int i = NB - 1; i >= 0; --i) solve_row(w + FACTORS, w + INVERSE, w + SWEPT, w + SOUGHT, OF(w), i);
}

IN_ROW void place_voltage(double *w, int i) {
    double *v = SLOT + AT_V;
    const double *s = w + SOUGHT;
    v[PERM[i]] = s[2 * i];
    v[NB + PERM[i]] = s[2 * i + 1];
}

IN_ROW void solve_wanted(double *w) {
    const struct reach *r = &OF(w)->reach;
    for (int k = 0; k < r->n_up; ++k) {
        solve_row(w + FACTORS, w + INVERSE, w + SWEPT, w + SOUGHT, OF(w), r->up[k]);
        place_voltage(w, r->up[k]);
    }
}

/* A loop over rows also for a processor with wider instructions, which take fewer of them: without contraction, so that
   each rounds as it does elsewhere. */
#include "registers.h"
#ifdef ASKS_FOR_REGISTERS
#define ROWS(name, loop)                                                                                               \
    __attribute__((target("avx2"))) static void name##_wide(double *w) { loop(w); }                                    \
    static void name(double *w) {                                                                                      \
        if (OF(w)->wide) name##_wide(w);                                                                               \
        else loop(w);                                                                                                  \
    }
#else
#define ROWS(name, loop)                                                                                               \
    static void name(double *w) { loop(w); }
#endif
ROWS(sweep_down, sweep_all)
ROWS(sweep_moved, sweep_moved_rows)
ROWS(solve_up, solve_all)
ROWS(solve_reached, solve_wanted)

/* The solution, in the order of elimination, from b by bus: real parts, then imaginary parts. */
static void through_factors(double *w) {
    sweep_down(w);
    solve_up(w);
    OF(w)->swept = NOTHING; /* b may be anybody's */
}

/* Whether a trial solution leaves hardly anything over. A network that is not passive may need pivoting. The currents
   follow no pattern that the network could have as well. */
static int accurate(double *w) {
    const double *m = w + ELEMENTS, *s = w + SOUGHT;
    double *b = w + CURRENT;
    for (int i = 0; i < NB; ++i) {
        b[i] = cos(i);
        b[NB + i] = sin(i);
    }
    through_factors(w);
    for (int i = 0; i < NB; ++i) {
        double re = -b[PERM[i]], im = -b[NB + PERM[i]], size = fabs(re) + fabs(im);
        for (int q = MROW[i]; q < MROW[i + 1]; ++q) {
            const double a = m[q] * s[2 * MCOL[q]] - m[NM + q] * s[2 * MCOL[q] + 1];
            const double c = m[q] * s[2 * MCOL[q] + 1] + m[NM + q] * s[2 * MCOL[q]];
            re += a;
            im += c;
            size += fabs(a) + fabs(c);
        }
        if (fabs(re) + fabs(im) > OF(w)->largest_rest * size) return 0;
    }
    return 1;
}

static void factorise_nodes(double *w) {
    double *m = w + ELEMENTS, *row = w + SOUGHT, *lu = w + FACTORS, *inverse = w + INVERSE, *made_of = w + MADE_OF + 1;
    evaluate(w, MATRIX, m);
    for (int i = 0; i < NB; ++i) {
        for (int q = ROW[i]; q < ROW[i + 1]; ++q) row[2 * COL[q]] = row[2 * COL[q] + 1] = 0;
        for (int q = MROW[i]; q < MROW[i + 1]; ++q) {
            row[2 * MCOL[q]] = m[q];
            row[2 * MCOL[q] + 1] = m[NM + q];
        }
        for (int q = ROW[i]; q < DIAG[i]; ++q) {
            const int k = COL[q];
            const double re = row[2 * k] * inverse[2 * k] - row[2 * k + 1] * inverse[2 * k + 1];
            const double im = row[2 * k] * inverse[2 * k + 1] + row[2 * k + 1] * inverse[2 * k];
            row[2 * k] = re;
            row[2 * k + 1] = im;
            for (int r = DIAG[k] + 1; r < ROW[k + 1]; ++r) {
                row[2 * COL[r]] -= re * lu[2 * r] - im * lu[2 * r + 1];
                row[2 * COL[r] + 1] -= re * lu[2 * r + 1] + im * lu[2 * r];
            }
        }
        for (int q = ROW[i]; q < ROW[i + 1]; ++q) {
            lu[2 * q] = row[2 * COL[q]];
            lu[2 * q + 1] = row[2 * COL[q] + 1];
        }
        const double square = row[2 * i] * row[2 * i] + row[2 * i + 1] * row[2 * i + 1];
        inverse[2 * i] = row[2 * i] / square;
        inverse[2 * i + 1] = -row[2 * i + 1] / square;
    }
    if (!accurate(w))
        for (int i = 0; i < 2 * NB; ++i) inverse[i] = NAN; /* no voltage is finite then, which the instance reports */
    memcpy(made_of, SLOT, U * sizeof *w);
    for (int k = 0; k < NG; ++k) made_of[U + k] = SLOT[U + GIVEN[k]];
    w[MADE_OF] = OF(w)->made_of_parameters = 1;
}

/* Currents, and rows down, as the slots have them: all, or those alone that the states have moved since. */
static void sweep(double *w) {
    const struct reach *r = &OF(w)->reach;
    double *b = w + CURRENT;
    if (OF(w)->swept == NOTHING) {
        if (!unchanged(w)) factorise_nodes(w);
        evaluate(w, CURRENTS, b);
        sweep_down(w);
    } else if (OF(w)->swept == BUT_STATES) {
        execute_moved(w);
        for (int k = 0; k < r->currents; ++k) take(w, CURRENTS, r->current[k], 1, b + r->current[k]);
        sweep_moved(w);
    }
    OF(w)->swept = ALL;
}

/* Voltages in their slots, by bus: real parts, then imaginary parts. ALL, or those WANTED by rates. */
static void solve_nodes(double *w, int which) {
    sweep(w);
    if (which == ALL) {
        solve_up(w);
        for (int i = 0; i < NB; ++i) place_voltage(w, i);
    } else {
        solve_reached(w);
    }
    OF(w)->settled = which;
}

static void settle_voltages(double *w, int which) {
    if (OF(w)->settled < which) solve_nodes(w, which);
}
