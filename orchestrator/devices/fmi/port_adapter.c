/* FMI 2.0 functions that speak the port of this project to the outside, and a foreign FMU's own variables to the inside.
   `bound_component.py` describes the same structures to Python. A component without a binding never comes here. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "many_steps.h"

enum { RECTANGULAR, POLAR, ABC, POWER };
enum { V_RE, V_IM, I_RE, I_IM, P, Q, FIRST_OTHER };
enum { CHUNK = 64 };

static const double THIRD = 2.0943951023931953; /* 2π/3 */

/* Any other variable: what the port shows is factor·x + offset. */
struct other {
    double factor, offset;
    unsigned reference, unused;
};

struct port {
    int64_t form;
    double matrix[4];    /* voltage: network → FMU's axes; current: FMU's axes → network, 100 MVA */
    double angle_factor; /* FMU's unit of angle per radian */
    double moment;       /* voltage in phases: of a step's middle (1/2), or of its begin (0) */
    unsigned references[4];
};

struct adapter {
    void *component;
    get_set set_real, get_real;
    do_step step;
    many_steps steps; /* NULL where each step is a call */
    const struct other *others;
    int64_t n_others;
    struct port voltage, current;
    double omega;       /* rated angular frequency [rad/s], for phase quantities */
    double power_scale; /* 100 MVA over the rating */
    /* What follows changes while it runs, and belongs to the state. */
    double v[2], time, angle;
};

static int send_voltage(struct adapter *a, double time) {
    const struct port *port = &a->voltage;
    const double *m = port->matrix;
    const double re = m[0] * a->v[0] + m[1] * a->v[1], im = m[2] * a->v[0] + m[3] * a->v[1];
    double values[3] = {re, im, 0};
    size_t n = 2;
    if (port->form == POLAR) {
        /* Without jumps by a full turn, which an FMU that filters the angle would take for a fault. */
        a->angle += remainder(atan2(im, re) - a->angle, 3 * THIRD);
        values[0] = hypot(re, im), values[1] = a->angle * port->angle_factor;
    } else if (port->form == ABC) {
        for (n = 0; n < 3; ++n) {
            const double phase = a->omega * time - THIRD * (double)n;
            values[n] = re * cos(phase) - im * sin(phase);
        }
    }
    return a->set_real(a->component, port->references, n, values);
}

static int read_current(struct adapter *a, double *i) {
    const struct port *port = &a->current;
    const double *m = port->matrix;
    double x[3] = {0, 0, 0}, re, im;
    const int status = a->get_real(a->component, port->references, port->form == ABC ? 3 : 2, x);
    if (port->form == POLAR) {
        re = x[0] * cos(x[1] / port->angle_factor), im = x[0] * sin(x[1] / port->angle_factor);
    } else if (port->form == ABC) {
        const double c = cos(a->omega * a->time), s = sin(a->omega * a->time);
        const double alpha = (2 * x[0] - x[1] - x[2]) / 3, beta = (x[1] - x[2]) / sqrt(3.0);
        re = alpha * c + beta * s, im = beta * c - alpha * s;
    } else if (port->form == POWER) { /* i = conj(s / v) */
        const double square = a->v[0] * a->v[0] + a->v[1] * a->v[1];
        re = square > 1e-12 ? (x[0] * a->v[0] + x[1] * a->v[1]) / square : 0;
        im = square > 1e-12 ? (x[0] * a->v[1] - x[1] * a->v[0]) / square : 0;
    } else {
        re = x[0], im = x[1];
    }
    i[0] = m[0] * re + m[1] * im, i[1] = m[2] * re + m[3] * im;
    return status;
}

EXPORT int adapter_set_real(struct adapter *a, const unsigned *references, size_t n, const double *values) {
    unsigned inner[CHUNK];
    double converted[CHUNK];
    size_t waiting = 0;
    int worst = 0, status, voltage = 0;
    for (size_t k = 0; k < n; ++k) {
        if (references[k] <= V_IM) {
            a->v[references[k]] = values[k], voltage = 1;
            continue;
        }
        if (references[k] < FIRST_OTHER || references[k] - FIRST_OTHER >= (uint64_t)a->n_others) return 3;
        const struct other *o = &a->others[references[k] - FIRST_OTHER];
        inner[waiting] = o->reference, converted[waiting++] = (values[k] - o->offset) / o->factor;
        if (waiting == CHUNK) {
            if ((status = a->set_real(a->component, inner, waiting, converted)) > worst) worst = status;
            waiting = 0;
        }
    }
    if (waiting && (status = a->set_real(a->component, inner, waiting, converted)) > worst) worst = status;
    if (voltage && (status = send_voltage(a, a->time)) > worst) worst = status;
    return worst;
}

EXPORT int adapter_get_real(struct adapter *a, const unsigned *references, size_t n, double *values) {
    unsigned inner[CHUNK];
    double fetched[CHUNK], i[2] = {0, 0};
    size_t places[CHUNK], waiting = 0;
    int worst = 0, status, current = 0;
    for (size_t k = 0; k <= n; ++k) {
        if (waiting && (k == n || waiting == CHUNK)) {
            if ((status = a->get_real(a->component, inner, waiting, fetched)) > worst) worst = status;
            for (size_t w = 0; w < waiting; ++w) {
                const struct other *o = &a->others[references[places[w]] - FIRST_OTHER];
                values[places[w]] = o->factor * fetched[w] + o->offset;
            }
            waiting = 0;
        }
        if (k == n) break;
        const unsigned reference = references[k];
        if (reference >= FIRST_OTHER) {
            if (reference - FIRST_OTHER >= (uint64_t)a->n_others) return 3;
            inner[waiting] = a->others[reference - FIRST_OTHER].reference, places[waiting++] = k;
            continue;
        }
        if (reference >= I_RE && !current) {
            if ((status = read_current(a, i)) > worst) worst = status;
            current = 1;
        }
        switch (reference) {
            case V_RE: case V_IM: values[k] = a->v[reference]; break;
            case I_RE: case I_IM: values[k] = i[reference - I_RE]; break;
            case P: values[k] = (a->v[0] * i[0] + a->v[1] * i[1]) * a->power_scale; break;
            default: values[k] = (a->v[1] * i[0] - a->v[0] * i[1]) * a->power_scale;
        }
    }
    return worst;
}

EXPORT int adapter_do_step(struct adapter *a, double time, double step, int no_set_state) {
    int status;
    /* Phase quantities turn while they are held: those of the middle of the step have the mean angle right, unless the
       FMU's own frame stands still as well. */
    if (a->voltage.form == ABC && (status = send_voltage(a, time + a->voltage.moment * step)) > 1) return status;
    status = a->step(a->component, time, step, no_set_state);
    a->time = time + step;
    if (a->voltage.form == ABC && status < 2) {
        const int sent = send_voltage(a, a->time);
        if (sent > status) status = sent;
    }
    return status;
}

/* Many steps: what each would set is written down first, then the FMU makes them all, then what it gave is converted. */
struct tape {
    double *row; /* where the voltage that is set now goes */
    double *late;
    const double *read;
    size_t n;
};

static int note_voltage(void *tape, const unsigned *references, size_t n, double *values) {
    memcpy(((struct tape *)tape)->row, values, n * sizeof *values);
    return 0;
}

static int note_step(void *noted, double time, double step, int no_set_state) {
    struct tape *tape = noted;
    memcpy(tape->late, tape->row, tape->n * sizeof *tape->late);
    tape->row = tape->late;
    return 0;
}

static int give_current(void *tape, const unsigned *references, size_t n, double *values) {
    memcpy(values, ((struct tape *)tape)->read, n * sizeof *values);
    return 0;
}

struct moment { double v[2], time, angle; };

static struct moment moment_of(const struct adapter *a) { return (struct moment){{a->v[0], a->v[1]}, a->time, a->angle}; }

static void go_to(struct adapter *a, struct moment moment) {
    a->v[0] = moment.v[0], a->v[1] = moment.v[1], a->time = moment.time, a->angle = moment.angle;
}

static size_t variables_of(const struct port *port) { return port->form == ABC ? 3 : 2; }

/* Whether only the voltage is set, and nothing read but the port. */
static int is_of_port(const struct steps *asked) {
    int fits = 1;
    for (int64_t k = 0; k < asked->n_in; ++k) fits = fits && asked->input_references[k] <= V_IM;
    for (int64_t k = 0; k < asked->n_out; ++k) fits = fits && asked->output_references[k] < FIRST_OTHER;
    return fits && asked->n_in > 0;
}

/* The same adapter before a tape instead of the FMU. */
static struct adapter before_tape(const struct adapter *a, struct tape *tape) {
    struct adapter noting = *a;
    noting.component = tape, noting.set_real = note_voltage, noting.get_real = give_current, noting.step = note_step;
    return noting;
}

static void note_steps(struct adapter *a, struct tape *tape, const struct steps *asked, double *in, struct moment *after) {
    const size_t n_in = (size_t)asked->n_in;
    double *late = tape->late;
    for (int64_t k = 0; k < asked->count; ++k) {
        tape->row = in + k * (int64_t)tape->n, tape->late = late + k * (int64_t)tape->n;
        adapter_set_real(a, asked->input_references, n_in, asked->inputs + k * asked->n_in);
        adapter_do_step(a, (double)(asked->index + k) * asked->step_size, asked->step_size, 1);
        if (asked->late) adapter_set_real(a, asked->input_references, n_in, asked->late + k * asked->n_in);
        after[k] = moment_of(a);
    }
}

static int make_steps(struct adapter *a, const struct steps *asked, int64_t *failed, double *room, struct moment *after) {
    const size_t n_in = variables_of(&a->voltage), n_out = variables_of(&a->current);
    double *late = room + asked->count * (int64_t)n_in, *out = late + asked->count * (int64_t)n_in;
    struct tape tape = {.row = room, .late = late, .n = n_in};
    struct adapter noting = before_tape(a, &tape);
    note_steps(&noting, &tape, asked, room, after);
    const struct steps own = {a->voltage.references, a->current.references, (int64_t)n_in, (int64_t)n_out, room,
                              asked->late || a->voltage.form == ABC ? late : NULL, out, asked->index, asked->count,
                              asked->step_size};
    const int status = a->steps(a->component, &own, failed);
    const int64_t made = status > 1 ? failed[0] : asked->count;
    for (int64_t k = 0; k < made; ++k) {
        tape.read = out + k * (int64_t)n_out;
        go_to(&noting, after[k]);
        adapter_get_real(&noting, asked->output_references, (size_t)asked->n_out, asked->outputs + k * asked->n_out);
    }
    if (made) go_to(a, after[made - 1]);
    return status;
}

/* 1 if these steps can be made at once. */
EXPORT int adapter_takes_many(const struct adapter *a, const struct steps *asked) { return a->steps && is_of_port(asked); }

EXPORT int adapter_many_steps(struct adapter *a, const struct steps *asked, int64_t *failed) {
    enum { NO_MEMORY = 3 };
    const size_t count = (size_t)asked->count, width = 2 * variables_of(&a->voltage) + variables_of(&a->current);
    double *room = malloc((count * width + 1) * sizeof *room);
    struct moment *after = malloc((count + 1) * sizeof *after);
    failed[0] = 0, failed[1] = CALLED_SET;
    const int status = room && after ? make_steps(a, asked, failed, room, after) : NO_MEMORY;
    free(room);
    free(after);
    return status;
}
