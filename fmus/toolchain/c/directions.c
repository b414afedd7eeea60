/* Exact derivatives of a tape's sections: products of their Jacobians with a direction, and of the transposed with a
   seed, from the slopes of each operation. `move` and `seed` have a place for each slot. */

/* Slopes of an operation by its operands v, where its value is f; as fmus/toolchain/symbols/derivatives.py has them. */
static void slopes(uint32_t code, const double *v, double f, double *by) {
    const double a = v[0], b = v[1], sign = (a > 0) - (a < 0) + 0 * a;
    by[0] = 1, by[1] = by[2] = by[3] = 0;
    switch (code) {
        case 0: by[1] = 1; break;
        case 1: by[1] = -1; break;
        case 2: by[0] = b, by[1] = a; break;
        case 3: by[0] = 1 / b, by[1] = -f / b; break;
        case 4: by[0] = b * pow(a, b - 1), by[1] = log(a) * f; break;
        case 5: by[0] = b / (a * a + b * b), by[1] = -a / (a * a + b * b); break;
        case 6: by[0] = sign * copysign(1, b); break;
        case 7: by[0] = (double)(a <= b) / ((a <= b) + (b <= a)), by[1] = (double)(b <= a) / ((a <= b) + (b <= a)); break;
        case 8: by[0] = (double)(b <= a) / ((a <= b) + (b <= a)), by[1] = (double)(a <= b) / ((a <= b) + (b <= a)); break;
        case 15: by[0] = 0, by[1] = 1; break; /* where a holds: `is_flat` */
        case 16: by[0] = -1; break;
        case 17: by[0] = -f * f; break;
        case 18: by[0] = a + a; break;
        case 19: by[0] = 2; break;
        case 20: by[0] = 1 / (f + f); break;
        case 21: by[0] = cos(a); break;
        case 22: by[0] = -sin(a); break;
        case 23: by[0] = 1 / (cos(a) * cos(a)); break;
        case 24: by[0] = f; break;
        case 25: by[0] = 1 / a; break;
        case 26: by[0] = sign; break;
        case 29: by[0] = b, by[1] = a, by[2] = 1; break;
        case 30: by[0] = b, by[1] = a, by[2] = -1; break;
        case 31: by[0] = -b, by[1] = -a, by[2] = 1; break;
        case 32: by[0] = b, by[1] = a, by[2] = v[3], by[3] = v[2]; break;
        case 33: by[0] = b, by[1] = a, by[2] = -v[3], by[3] = -v[2]; break;
    }
}

/* Whether an operation has the same value beside this point, whatever its operands do: comparisons, logic, floor, and a
   value that is left out. */
static int is_flat(uint32_t code, double a) { return (code >= 9 && code <= 14) || code == 27 || code == 28 || (code == 15 && !a); }

/* Whether an operand can move at all, and matters. One that happens to stand still counts: where the slope is infinite,
   as that of a root at zero, there is no derivative. */
static int moves(const double *w, uint32_t code, int at, int side) {
    return (at < AT_GH || at >= AT_FIXED) && !(code == 6 && side == 1) && !(code == 15 && side == 0);
}

/* Slopes of the operation with these operands. */
static void slopes_at(const double *w, uint32_t code, const uint32_t *at, int out, double *by) {
    double v[4] = {0};
    for (int k = 0; k < TAKES[code]; ++k) v[k] = SLOT[at[k]];
    slopes(code, v, SLOT[out], by);
}

static int first_of(const double *w, int which) { return which == FIXED ? AT_FIXED : AT_FIXED + OF(w)->size.fixed; }

/* Move what a section computes as its operands move; the section was executed. */
static void move_on(const double *w, int which, double *move) {
    const uint32_t *run = OF(w)->run[which], *at = OF(w)->operand[which];
    int out = first_of(w, which);
    double by[4];
    for (int k = 0; k < OF(w)->size.section[which].runs; ++k, run += 2)
        for (uint32_t n = 0; n < run[1]; ++n, ++out, at += TAKES[run[0]]) {
            move[out] = 0;
            if (is_flat(run[0], SLOT[at[0]])) continue;
            slopes_at(w, run[0], at, out, by);
            for (int side = 0; side < TAKES[run[0]]; ++side)
                if (moves(w, run[0], (int)at[side], side)) move[out] += by[side] * move[at[side]];
        }
}

/* Add to the seeds of a section's operands what its values, whose seeds end here, hand back; it was executed. */
static void move_back(const double *w, int which, double *seed) {
    const struct section s = OF(w)->size.section[which];
    const uint32_t *run = OF(w)->run[which] + 2 * s.runs, *at = OF(w)->operand[which] + s.operands;
    int out = first_of(w, which);
    double by[4];
    for (int k = 0; k < s.runs; ++k) out += (int)OF(w)->run[which][2 * k + 1];
    while (run > OF(w)->run[which]) {
        run -= 2;
        for (uint32_t n = 0; n < run[1]; ++n) {
            const double own = seed[--out];
            at -= TAKES[run[0]];
            seed[out] = 0;
            if (own == 0 || is_flat(run[0], SLOT[at[0]])) continue;
            slopes_at(w, run[0], at, out, by);
            for (int side = 0; side < TAKES[run[0]]; ++side) seed[at[side]] += by[side] * own;
        }
    }
}

static void compute(double *w, int which) { execute(w, which, SLOT + first_of(w, which)); }

/* Moves of n results of a section, from number `first` on. */
static void give_moves(double *w, int which, const double *move, int first, int n, double *to) {
    for (int k = 0; k < n; ++k) to[k] = move[OF(w)->result[which][first + k]];
}

static void take_seeds(double *w, int which, double *seed, int first, int n, const double *from) {
    for (int k = 0; k < n; ++k) seed[OF(w)->result[which][first + k]] += from[k];
}

/* The element q of dY, in row i of the elimination, times the voltage there; and its part of a right side. */
static void move_voltages(double *w, double *move) {
    const double *s = w + SOUGHT;
    double *b = w + CURRENT, *found = w + ELEMENTS, *v = move + AT_V;
    compute(w, CURRENTS);
    move_on(w, CURRENTS, move);
    give_moves(w, CURRENTS, move, 0, 2 * NB, b);
    compute(w, MATRIX);
    move_on(w, MATRIX, move);
    give_moves(w, MATRIX, move, 0, 2 * NM, found);
    for (int i = 0; i < NB; ++i)
        for (int q = MROW[i]; q < MROW[i + 1]; ++q) {
            const double *x = s + 2 * MCOL[q];
            b[PERM[i]] -= found[q] * x[0] - found[NM + q] * x[1];
            b[NB + PERM[i]] -= found[q] * x[1] + found[NM + q] * x[0];
        }
    through_factors(w);
    for (int i = 0; i < NB; ++i) {
        v[PERM[i]] = s[2 * i];
        v[NB + PERM[i]] = s[2 * i + 1];
    }
}

/* The transposed: seeds of voltages go over the transposed factors to those of currents and of elements of Y. */
static void seed_voltages(double *w, double *seed) {
    const double *lu = w + FACTORS, *inverse = w + INVERSE, *v = SLOT + AT_V;
    double *y = w + SOUGHT, *back = w + CURRENT, *elements = w + ELEMENTS, *own = seed + AT_V;
    for (int i = 0; i < NB; ++i) {
        y[2 * i] = own[PERM[i]];
        y[2 * i + 1] = own[NB + PERM[i]];
    }
    memset(own, 0, 2 * NB * sizeof *own);
    for (int i = 0; i < NB; ++i) {
        const double re = y[2 * i] * inverse[2 * i] + y[2 * i + 1] * inverse[2 * i + 1];
        const double im = y[2 * i + 1] * inverse[2 * i] - y[2 * i] * inverse[2 * i + 1];
        y[2 * i] = re, y[2 * i + 1] = im;
        for (int q = DIAG[i] + 1; q < ROW[i + 1]; ++q) {
            y[2 * COL[q]] -= lu[2 * q] * re + lu[2 * q + 1] * im;
            y[2 * COL[q] + 1] -= lu[2 * q] * im - lu[2 * q + 1] * re;
        }
    }
    for (int i = NB - 1; i >= 0; --i)
        for (int q = ROW[i]; q < DIAG[i]; ++q) {
            y[2 * COL[q]] -= lu[2 * q] * y[2 * i] + lu[2 * q + 1] * y[2 * i + 1];
            y[2 * COL[q] + 1] -= lu[2 * q] * y[2 * i + 1] - lu[2 * q + 1] * y[2 * i];
        }
    for (int i = 0; i < NB; ++i) {
        const double re = y[2 * i], im = y[2 * i + 1];
        back[PERM[i]] = re, back[NB + PERM[i]] = im;
        for (int q = MROW[i]; q < MROW[i + 1]; ++q) {
            const double x = v[PERM[MCOL[q]]], z = v[NB + PERM[MCOL[q]]];
            elements[q] = -(re * x + im * z);
            elements[NM + q] = re * z - im * x;
        }
    }
    compute(w, MATRIX);
    take_seeds(w, MATRIX, seed, 0, 2 * NM, elements);
    move_back(w, MATRIX, seed);
    compute(w, CURRENTS);
    take_seeds(w, CURRENTS, seed, 0, 2 * NB, back);
    move_back(w, CURRENTS, seed);
    OF(w)->swept = NOTHING;
}

/* Everything that derivatives at z need, but for the sections that are asked for. Voltages are always solved for: a
   direction takes them in the order of elimination too, where the one before left its own. */
static void settle(double *w, const double *z) {
    enter(z, w);
    memcpy(SLOT + X, z + X, NX * sizeof *z);
    OF(w)->swept = NOTHING;
    if (NB) solve_nodes(w, ALL);
}

/* Directions over all variables: what is known goes in, what follows comes out; with `start`, from the parameters on. */
static void move_all(double *w, const double *z, int start, double *d, double *move) {
    if (start) {
        memcpy(SLOT, z, NP * sizeof *z);
        OF(w)->known = 0;
        compute(w, INITIALISE);
        memcpy(move, d, NP * sizeof *d);
        move_on(w, INITIALISE, move);
        give_moves(w, INITIALISE, move, 0, NC, d + C);
        give_moves(w, INITIALISE, move, NC, NX, d + X);
    }
    settle(w, z);
    memcpy(move, d, Y * sizeof *d);
    memset(move + Y, 0, (size_t)(OF(w)->size.slots - Y) * sizeof *move);
    move_on(w, FIXED, move);
    if (NB) move_voltages(w, move);
    compute(w, OUTPUTS);
    move_on(w, OUTPUTS, move);
    give_moves(w, OUTPUTS, move, 0, NY, d + Y);
    compute(w, DERIVATIVES);
    move_on(w, DERIVATIVES, move);
    give_moves(w, DERIVATIVES, move, 0, NX, d + DX);
}

/* The transposed: seeds on what follows go in, what is known comes out. */
static void seed_all(double *w, const double *z, int start, double *d, double *seed) {
    memset(seed, 0, (size_t)OF(w)->size.slots * sizeof *seed);
    settle(w, z);
    compute(w, OUTPUTS);
    take_seeds(w, OUTPUTS, seed, 0, NY, d + Y);
    move_back(w, OUTPUTS, seed);
    compute(w, DERIVATIVES);
    take_seeds(w, DERIVATIVES, seed, 0, NX, d + DX);
    move_back(w, DERIVATIVES, seed);
    if (NB) seed_voltages(w, seed);
    move_back(w, FIXED, seed);
    if (start) { /* states and calculated parameters follow from the parameters here */
        for (int i = 0; i < NC; ++i) d[C + i] += seed[C + i];
        for (int i = 0; i < NX; ++i) d[X + i] += seed[X + i];
        memset(seed + Y, 0, (size_t)(OF(w)->size.slots - Y) * sizeof *seed);
        memcpy(SLOT, z, NP * sizeof *z);
        OF(w)->known = 0;
        compute(w, INITIALISE);
        take_seeds(w, INITIALISE, seed, 0, NC, d + C);
        take_seeds(w, INITIALISE, seed, NC, NX, d + X);
        move_back(w, INITIALISE, seed);
    }
    memcpy(d, seed, Y * sizeof *d);
}
