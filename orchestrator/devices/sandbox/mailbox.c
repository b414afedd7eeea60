/* A mailbox in memory that two processes share: one runs an FMU, the other calls it as if it were its own.
   `mailbox.py` describes the same structure to Python. The server's side is in the reach of a foreign FMU's code: what
   the client needs to know for itself, and where in this memory it writes, stands in memory of its own (struct client).

   What is set waits until a step or a reading needs it, and a step brings the values along that were read after the
   last one: a communication step costs one exchange between the processes and not three. Many steps may be asked for
   at once (RUN): of the instance, or of one of several. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "clock.h"
#include "many_steps.h"
#include "waiting.h"

#ifdef UNDER_WINE /* which only answers */
static int is_gone(int64_t process) { return 0; }
static int is_orphan(int64_t parent) { return older_wine() && of_linux(LINUX_GETPPID, 0, 0, 0, 0) != parent; }
#elif defined _WIN32
static int is_gone(int64_t process) {
    DWORD code;
    return !GetExitCodeProcess((HANDLE)(intptr_t)process, &code) || code != STILL_ACTIVE;
}
static int is_orphan(int64_t parent) { return 0; } /* the parent ends what it started */
#else
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
/* Without reaping it: whoever started it asks for its exit code. */
static int is_gone(int64_t process) {
    siginfo_t info = {0};
    return waitid(P_PID, (id_t)process, &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid != 0;
}
static int is_orphan(int64_t parent) { return (int64_t)getppid() != parent; }
#endif

enum { MOST = 16384, TEXT = 1 << 24, LOG = 8192, ROOM = 1 << 18 };
enum { OK = 0, REFUSED = 3, DIED = 64, HUNG = 65, NOT_A_NUMBER = 66, INTERRUPTED = 67, TAMPERED = 68 };
enum { MOST_STATUS = 5 }; /* of FMI's */
enum { EXCHANGE = 1, TALK = 2, RUN = 3 };
enum { SET = 1, STEP = 2, GET = 4 }; /* what an exchange does, and the stage of a run */

struct mailbox {
    volatile int32_t request, reply; /* numbers of the newest question and of the newest answer */
    volatile int32_t sleeping[2];    /* whether the server, or the client, waits in the kernel */
    int32_t kind, what, status;
    int32_t steps;
    double time, step;
    int64_t n_set, n_get;
    int64_t text_length;
    uint32_t set_references[MOST], get_references[MOST];
    double set_values[MOST], got[MOST];
    char text[TEXT];
    char log[LOG];
    /* RUN: `n_rows` rows of inputs in `room`, then `n_late` rows that are set after each step, before it is read, then a
       row of outputs for each step, or one for none; then the network of `n_network` states around the instance, if it
       has one: x, A, B, C. */
    int64_t instance, n_steps, n_rows, n_in, n_out, n_network, n_late;
    int64_t done, stage; /* steps that are finished; what it is at: SET, STEP or GET */
    double room[ROOM];
};

/* The client's own memory. */
struct client {
    struct mailbox *box;
    int64_t peer; /* the server's process */
    double patience;
    int64_t n_set, n_get;
    int32_t number; /* of the newest question */
    uint32_t bad_reference, fresh; /* fresh: `got` holds what was read after the last step, and nothing was set since */
    uint32_t get_references[MOST];
};

/* How often a word is looked at before a process sleeps: worth it where the other one has a processor of its own, and a
   waste of time where both share one. So it is given up after some vain attempts, and tried again later. */
enum { SPINS = 1000, VAIN = 4, LATER = 1000 };
static int spins = SPINS, vain, sleeps;

EXPORT size_t mailbox_size(void) { return sizeof(struct mailbox); }
EXPORT size_t client_size(void) { return sizeof(struct client); }
EXPORT size_t mailbox_offset(int which) {
    const size_t places[] = {offsetof(struct mailbox, text), offsetof(struct mailbox, log),
                             offsetof(struct mailbox, instance), offsetof(struct mailbox, set_references),
                             offsetof(struct mailbox, get_references), offsetof(struct mailbox, room)};
    return places[which];
}

/* Wait until *word is no longer `old`: awake for a while, then in the kernel. Returns 0 after every sleep. */
static int changed(volatile int32_t *word, int32_t old, volatile int32_t *sleeping) {
    for (int k = 0; k < spins; ++k) {
        if (__atomic_load_n(word, __ATOMIC_ACQUIRE) != old) {
            vain = 0;
            return 1;
        }
        relax();
    }
    if (spins && ++vain >= VAIN)
        spins = vain = 0;
    else if (!spins && ++sleeps >= LATER)
        spins = SPINS, sleeps = 0;
    __atomic_store_n(sleeping, 1, __ATOMIC_SEQ_CST);
    if (__atomic_load_n(word, __ATOMIC_SEQ_CST) == old) rest(word, old);
    __atomic_store_n(sleeping, 0, __ATOMIC_SEQ_CST);
    return __atomic_load_n(word, __ATOMIC_ACQUIRE) != old;
}

static void publish(volatile int32_t *word, int32_t value, volatile int32_t *sleeping) {
    __atomic_store_n(word, value, __ATOMIC_SEQ_CST);
    if (__atomic_load_n(sleeping, __ATOMIC_SEQ_CST)) wake(word);
}

/* Has Python look for signals, which it does not by itself while C waits; *asked then says whether Ctrl-C was among them.
   The other process is given a moment to answer, so that the run can be kept at a whole step. */
enum { MOMENT = 2 };
static int (*look)(void);
static const volatile int *asked;
EXPORT void mailbox_heed(int (*function)(void), const int *flag) { look = function, asked = flag; }

static int32_t next_number(int32_t number) { return (int32_t)((uint32_t)number + 1); }

/* The status that the server left, one of FMI's. */
static int answer_in(const struct mailbox *box) {
    const int status = *(const volatile int32_t *)&box->status;
    return status < OK || status > MOST_STATUS ? TAMPERED : status;
}

/* Ask, and wait for the answer: the call's status, or DIED, HUNG, INTERRUPTED or TAMPERED. With each of so many steps
   (`may_step`) the patience begins anew. */
static int ask(struct client *client, int32_t kind, int64_t may_step) {
    struct mailbox *box = client->box;
    const int32_t before = client->number;
    client->number = next_number(before);
    box->kind = kind;
    publish(&box->request, client->number, &box->sleeping[0]);
    double end = seconds() + client->patience;
    int32_t steps = box->steps;
    double last = 0; /* moment for an answer after Ctrl-C */
    while (!changed(&box->reply, before, &box->sleeping[1])) {
        if (is_gone(client->peer)) return box->reply == client->number ? answer_in(box) : DIED;
        if (may_step > 0 && box->steps != steps) steps = box->steps, end = seconds() + client->patience, --may_step;
        if (seconds() > end) return HUNG;
        if (look && look()) return INTERRUPTED;
        if (look && *asked) {
            if (last == 0) last = seconds() + MOMENT;
            if (seconds() > last) return INTERRUPTED;
        }
    }
    return box->reply == client->number ? answer_in(box) : TAMPERED;
}

static int exchange(struct client *client, int what) {
    client->box->what = what | (client->n_set ? SET : 0);
    client->box->n_set = client->n_set, client->box->n_get = client->n_get;
    const int status = ask(client, EXCHANGE, 0);
    client->n_set = 0;
    client->fresh = status <= 1 && (what & GET);
    return status;
}

EXPORT int mailbox_talk(struct client *client) {
    int status = OK;
    if (client->n_set && (status = exchange(client, 0)) > 1) return status;
    client->fresh = 0;
    return ask(client, TALK, 0);
}

EXPORT int client_set_real(struct client *client, const unsigned *references, size_t n, const double *values) {
    int status = OK;
    if (n > MOST) return REFUSED;
    if (client->n_set + (int64_t)n > MOST && (status = exchange(client, 0)) > 1) return status;
    memcpy(client->box->set_references + client->n_set, references, n * sizeof *references);
    memcpy(client->box->set_values + client->n_set, values, n * sizeof *values);
    client->n_set += (int64_t)n;
    client->fresh = 0;
    return status;
}

EXPORT int client_get_real(struct client *client, const unsigned *references, size_t n, double *values) {
    int status = OK;
    if (n > MOST) return REFUSED;
    if (!client->fresh || (int64_t)n != client->n_get || memcmp(references, client->get_references, n * sizeof *references)) {
        memcpy(client->get_references, references, n * sizeof *references);
        memcpy(client->box->get_references, references, n * sizeof *references);
        client->n_get = (int64_t)n;
        if ((status = exchange(client, GET)) > 1) return status;
    }
    memcpy(values, client->box->got, n * sizeof *values);
    for (size_t k = 0; k < n; ++k)
        if (!isfinite(values[k])) {
            client->bad_reference = references[k];
            return NOT_A_NUMBER;
        }
    return status;
}

EXPORT int client_do_step(struct client *client, double time, double step, int no_set_state) {
    client->box->time = time, client->box->step = step;
    return exchange(client, STEP | GET);
}

/* The number of rows before the first one with a value that is not finite, whose reference is kept. */
static int64_t finite_rows(struct client *client, const double *values, int64_t n_rows, int64_t n_out) {
    for (int64_t k = 0; k < n_rows * n_out; ++k)
        if (!isfinite(values[k])) {
            client->bad_reference = client->get_references[k % n_out];
            return k / n_out;
        }
    return n_rows;
}

/* Rows of inputs and of late ones in, rows of outputs back, as many as the room holds; *done of them are read. */
static int ask_for_steps(struct client *client, const struct steps *some, int64_t *done) {
    struct mailbox *box = client->box;
    const int64_t n_rows = some->count * some->n_in;
    double *late = box->room + n_rows, *out = late + (some->late ? n_rows : 0);
    memcpy(box->room, some->inputs, (size_t)n_rows * sizeof *late);
    if (some->late) memcpy(late, some->late, (size_t)n_rows * sizeof *late);
    box->instance = 0, box->n_network = 0, box->n_in = some->n_in, box->n_out = some->n_out;
    box->n_steps = box->n_rows = some->count, box->n_late = some->late ? some->count : 0;
    box->time = (double)some->index * some->step_size, box->step = some->step_size;
    box->done = 0, box->stage = SET;
    const int status = ask(client, RUN, some->count);
    const int64_t said = status <= 1 ? some->count : *(const volatile int64_t *)&box->done;
    const int64_t read = said < 0 || said > some->count ? 0 : said;
    memcpy(some->outputs, out, (size_t)(read * some->n_out) * sizeof *out);
    *done = finite_rows(client, some->outputs, read, some->n_out);
    return *done < read ? NOT_A_NUMBER : status;
}

/* Many steps, of which each costs no exchange. failed[0]: steps that were made; failed[1]: the call that failed. */
EXPORT int client_many_steps(struct client *client, const struct steps *asked, int64_t *failed) {
    struct mailbox *box = client->box;
    struct steps some = *asked;
    int status = OK;
    failed[0] = 0, failed[1] = CALLED_SET;
    if (some.n_in > MOST || some.n_out > MOST) return REFUSED;
    if (client->n_set && (status = exchange(client, 0)) > 1) return status;
    client->fresh = 0, client->n_get = some.n_out;
    memcpy(client->get_references, some.output_references, (size_t)some.n_out * sizeof(unsigned));
    memcpy(box->get_references, some.output_references, (size_t)some.n_out * sizeof(unsigned));
    memcpy(box->set_references, some.input_references, (size_t)some.n_in * sizeof(unsigned));
    const int64_t width = (some.late ? 2 : 1) * some.n_in + some.n_out, most = width ? ROOM / width : asked->count;
    while (failed[0] < asked->count) {
        const int64_t left = asked->count - failed[0];
        int64_t done;
        some.count = left < most ? left : most;
        status = ask_for_steps(client, &some, &done);
        failed[0] += done;
        if (status > 1) {
            const int64_t stage = *(const volatile int64_t *)&box->stage;
            failed[1] = status == NOT_A_NUMBER || stage == GET ? CALLED_GET : stage == SET ? CALLED_SET : CALLED_STEP;
            return status;
        }
        some.index += done, some.inputs += done * some.n_in, some.outputs += done * some.n_out;
        if (some.late) some.late += done * some.n_in;
    }
    return status;
}

static int serve(struct mailbox *box, void *component, get_set set_real, get_set get_real, do_step step) {
    int worst = OK, status;
    if ((box->what & SET) && (status = set_real(component, box->set_references, (size_t)box->n_set, box->set_values)) > worst)
        worst = status;
    if (worst > 1) return worst;
    if (box->what & STEP) {
        ++box->steps;
        if ((status = step(component, box->time, box->step, 1)) > worst) worst = status;
        if (worst > 1) return worst;
    }
    if ((box->what & GET) && box->n_get &&
        (status = get_real(component, box->get_references, (size_t)box->n_get, box->got)) > worst)
        worst = status;
    return worst;
}

/* One instance of several that a process serves; none where its component is NULL. */
struct served {
    void *component;
    get_set set_real, get_real;
    do_step step;
};

/* A linear network around an instance: its inputs are row + C·x; what is read after a step makes x to A·x + B·out. */
enum { NETWORK = 16 }; /* states, at most */
struct network {
    int64_t n, n_in, n_out;
    double *x;
    const double *A, *B, *C;
};

static struct network network_in(struct mailbox *box) {
    const int64_t n = box->n_network, length = box->n_steps > 1 ? box->n_steps : 1;
    double *x = box->room + (box->n_rows + box->n_late) * box->n_in + length * box->n_out;
    return (struct network){n, box->n_in, box->n_out, x, x + n, x + n + n * n, x + n + n * n + n * box->n_out};
}

static const double *fed(const struct network *net, const double *row) {
    static double values[MOST];
    for (int64_t j = 0; j < net->n_in; ++j) {
        values[j] = row[j];
        for (int64_t l = 0; l < net->n; ++l) values[j] += net->C[j * net->n + l] * net->x[l];
    }
    return values;
}

static void move_on(const struct network *net, const double *out) {
    double x[NETWORK];
    for (int64_t j = 0; j < net->n; ++j) {
        x[j] = 0;
        for (int64_t l = 0; l < net->n; ++l) x[j] += net->A[j * net->n + l] * net->x[l];
        for (int64_t l = 0; l < net->n_out; ++l) x[j] += net->B[j * net->n_out + l] * out[l];
    }
    memcpy(net->x, x, (size_t)net->n * sizeof *x);
}

static int run(struct mailbox *box, const struct served *served) {
    double *in = box->room, *late = in + box->n_rows * box->n_in, *out = late + box->n_late * box->n_in;
    int worst = OK, status;
    const struct network net = network_in(box);
    if (net.n < 0 || net.n > NETWORK || (net.n && (box->n_rows != 1 || net.n_in > MOST))) return REFUSED;
    /* Time is a whole number of steps where it can be: a sum would pass an FMU's end by a rounding error. */
    const double first = nearbyint(box->time / box->step);
    const int whole = fabs(first * box->step - box->time) <= 1e-9 * box->step;
    box->done = 0;
    for (int64_t k = 0;; ++k) {
        const double time = whole ? (first + (double)k) * box->step : box->time + (double)k * box->step;
        box->stage = SET;
        if (box->n_in && (net.n || k < box->n_rows)) {
            const double *row = net.n ? fed(&net, in) : in + k * box->n_in;
            if ((status = served->set_real(served->component, box->set_references, (size_t)box->n_in, row)) > worst)
                if ((worst = status) > 1) return worst;
        }
        box->stage = STEP;
        if (box->n_steps) {
            ++box->steps;
            if ((status = served->step(served->component, time, box->step, 1)) > worst)
                if ((worst = status) > 1) return worst;
        }
        if (k < box->n_late) {
            box->stage = SET;
            if ((status = served->set_real(served->component, box->set_references, (size_t)box->n_in, late + k * box->n_in)) > worst)
                if ((worst = status) > 1) return worst;
        }
        box->stage = GET;
        if (box->n_out &&
            (status = served->get_real(served->component, box->get_references, (size_t)box->n_out, out + k * box->n_out)) > worst)
            if ((worst = status) > 1) return worst;
        if (net.n) move_on(&net, out + k * box->n_out);
        box->done = k + 1;
        if (k + 1 >= box->n_steps) return worst;
    }
}

/* Answer exchanges and runs until something comes that C cannot answer: 1 for talk, 0 if the client is gone. */
EXPORT int mailbox_serve(struct mailbox *box, int64_t parent, void *component, get_set set_real, get_set get_real,
                         do_step step) {
    const struct served served = {component, set_real, get_real, step};
    for (;;) {
        while (!changed(&box->request, box->reply, &box->sleeping[0]))
            if (is_orphan(parent)) return 0;
        if (!component || (box->kind != EXCHANGE && box->kind != RUN)) return 1;
        box->status = box->kind == RUN ? run(box, &served) : serve(box, component, set_real, get_real, step);
        publish(&box->reply, box->request, &box->sleeping[1]);
    }
}

/* As `mailbox_serve`, for several instances, of which every question names one. */
EXPORT int mailbox_host(struct mailbox *box, int64_t parent, const struct served *table, int64_t n) {
    for (;;) {
        while (!changed(&box->request, box->reply, &box->sleeping[0]))
            if (is_orphan(parent)) return 0;
        if (box->kind != RUN || box->instance < 0 || box->instance >= n || !table[box->instance].component) return 1;
        box->status = run(box, table + box->instance);
        publish(&box->reply, box->request, &box->sleeping[1]);
    }
}

/* Ask without waiting. The number is the asker's own: what lies in shared memory, the other side may have written. */
EXPORT void mailbox_post(struct mailbox *box, int32_t kind, int32_t number) {
    box->kind = kind;
    publish(&box->request, number, &box->sleeping[0]);
}

/* 1 if the question of that number is answered, 0 if not within `most` seconds, -1 if something else was answered. */
EXPORT int mailbox_wait(struct mailbox *box, int32_t number, double most) {
    const double end = seconds() + most;
    while (!changed(&box->reply, number - 1, &box->sleeping[1]))
        if (seconds() > end) return 0;
    return box->reply == number ? 1 : -1;
}

/* The answer to a talk. */
EXPORT void mailbox_answer(struct mailbox *box, int status) {
    box->status = status;
    publish(&box->reply, box->request, &box->sleeping[1]);
}
