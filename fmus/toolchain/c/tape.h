/* A tape in memory, as fmus/toolchain/tape.py writes it, and the workspace of an instance that executes it. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#ifndef TAPE /* a native FMU keeps a tape's functions to itself */
#define TAPE EXPORT
#endif

enum { VERSION = 1, FIXED = 0, INITIALISE, REQUIREMENTS, OUTPUTS, DERIVATIVES, MATRIX, CURRENTS, SECTIONS };

struct section {
    int32_t runs, results, operands;
};

struct sizes { /* all there is, but for the lists of these lengths */
    int32_t np, nc, nu, nx, ny, implicit, held, given, buses, rank, nm, nlu, numbers, fixed, slots;
    struct section section[SECTIONS];
};

struct header {
    char magic[8];
    uint32_t version, bytes, checksum, unused; /* the checksum (CRC-32) is of all that follows */
    double largest_rest;
    struct sizes size;
};

/* How much of a network's solution is that of the slots. */
enum { NOTHING, BUT_STATES, WANTED, ALL }; /* all but what states reach; the voltages that rates want */

struct reach { /* as `reach.c` finds it */
    int32_t *down, *from, *up, *current, *run, *place; /* from: of each row down, its first element that a state moves */
    uint32_t *operand;
    int32_t n_down, n_up, currents, runs;
};

/* The beginning of every workspace. Behind it lie the slots (p, c, u, x, v, gh, numbers, what is fixed by p and c, what
   a section computes), then what an integrator or a network keeps. */
struct tape {
    struct sizes size;
    double largest_rest; /* part of its terms that a row of Y v = i may leave over; with more, no voltage is finite */
    int known; /* whether the slots of p and c, and those that they fix, are filled */
    int swept;   /* NOTHING, BUT_STATES or ALL: which currents and rows down are of what the slots of p, c, u and x hold */
    int settled; /* NOTHING, WANTED or ALL: which slots of v hold the voltages there */
    int outputs_when_read; /* whether a step leaves a network's outputs to whoever reads them */
    int wide; /* whether the processor has AVX2 */
    int made_of_parameters; /* whether a network's factors are known to be of what the slots of p and c hold */
    const int32_t *stepwise, *given_at, *perm, *row, *col, *diag, *mrow, *mcol;
    struct reach reach;
    const uint32_t *run[SECTIONS], *result[SECTIONS], *operand[SECTIONS]; /* run: code and length of each */
};

#define OF(w) ((struct tape *)(w))
#define NP (OF(w)->size.np)
#define NC (OF(w)->size.nc)
#define NU (OF(w)->size.nu)
#define NX (OF(w)->size.nx)
#define NY (OF(w)->size.ny)
#define NS (OF(w)->size.held)
#define NG (OF(w)->size.given)
#define NB (OF(w)->size.buses)
#define NM (OF(w)->size.nm)
#define NLU (OF(w)->size.nlu)
#define STEPWISE (OF(w)->stepwise)
#define GIVEN (OF(w)->given_at)
#define PERM (OF(w)->perm)
#define ROW (OF(w)->row)
#define COL (OF(w)->col)
#define DIAG (OF(w)->diag)
#define MROW (OF(w)->mrow)
#define MCOL (OF(w)->mcol)
#define C NP
#define U (C + NC)
#define X (U + NU)
#define Y (X + NX)
#define DX (Y + NY)
#define SLOT (w + (sizeof(struct tape) + 7) / 8)
#define OWN ((int)(SLOT - w) + OF(w)->size.slots) /* place of what an integrator or a network keeps */
#define AT_V (X + NX)
#define AT_GH (AT_V + 2 * NB)
#define AT_FIXED (AT_GH + 1 + OF(w)->size.numbers)
