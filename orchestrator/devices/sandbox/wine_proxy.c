/* The functions of FMI 2.0 on Linux, of an FMU whose library for Windows runs under Wine (wine_host.c). */

typedef void (*message)(void *, const char *, int, const char *, const char *, ...);
struct callbacks {
    message logger;
    void *allocate, *release, *finished, *environment;
};

struct proxy {
    struct client client;
    struct callbacks callbacks;
    char *name;
};

static struct client next;

/* The next instance is the one that this process under Wine serves. */
EXPORT void wine_attach(struct mailbox *box, int64_t process) {
    memset(&next, 0, sizeof next);
    next.box = box, next.peer = process, next.number = box->reply, next.patience = 1e300; /* whoever waits for this process has a limit of its own */
}

static struct talk *talk(struct proxy *p) { return (struct talk *)p->client.box->text; }

/* Pass on what the FMU said in a call. */
static void deliver(struct proxy *p) {
    struct said *s = (struct said *)p->client.box->log;
    const int count = s->count, bytes = s->bytes < (int)sizeof s->records ? s->bytes : (int)sizeof s->records;
    if (!count) return;
    s->count = s->bytes = 0;
    static const char nothing[] = "";
    const char *at = s->records, *end = s->records + bytes, *text = nothing, *category = nothing;
    int status = 0, k = 0;
    while (at < end) {
        status = atoi(at);
        category = at + strnlen(at, (size_t)(end - at)) + 1;
        if (category >= end) break;
        text = category + strnlen(category, (size_t)(end - category)) + 1;
        if (text >= end) break;
        at = text + strnlen(text, (size_t)(end - text)) + 1;
        if (at > end) break;
        p->callbacks.logger(p->callbacks.environment, p->name, status, category, "%s", text);
        ++k;
    }
    for (; k < count && at > s->records; ++k) /* there was no room for these */
        p->callbacks.logger(p->callbacks.environment, p->name, status, category, "%s", text);
}

static int ended(struct proxy *p, int status) {
    deliver(p);
    if (status == NOT_A_NUMBER) return OK; /* whoever asked looks for itself */
    if (status < DIED) return status;
    p->callbacks.logger(p->callbacks.environment, p->name, FMI_FATAL, "logStatusFatal", "%s",
                        "its process under Wine has ended: the Windows library crashed or ended it");
    return FMI_FATAL;
}

static int talked(struct proxy *p, int command) {
    talk(p)->command = command;
    return ended(p, mailbox_talk(&p->client));
}

/* Ask; the FMU's own status. */
static int called_for(struct proxy *p, int command) {
    const int status = talked(p, command);
    return status > FMI_WARNING ? status : (int)talk(p)->result;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

/* A file of this machine, as Wine names it. */
static void wine_uri(char *to, size_t room, const char *uri) {
    const char *path = !strncmp(uri, "file:///", 8) ? uri + 8 : NULL;
    snprintf(to, room, path ? "file:///Z:/%s" : "%s", path ? path : uri);
}

EXPORT void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources, const struct callbacks *callbacks,
                             int visible, int logging) {
    struct proxy *p = calloc(1, sizeof *p);
    if (!p || !next.box) return free(p), NULL;
    p->client = next, next.box = NULL;
    p->callbacks = *callbacks, p->name = strdup(name);
    struct talk *t = talk(p);
    char *at = (char *)t->data;
    at += snprintf(at, 4096, "%s", name) + 1;
    at += snprintf(at, 4096, "%s", guid) + 1;
    wine_uri(at, 8192, resources ? resources : "");
    t->a[0] = visible, t->a[1] = logging;
    if (talked(p, INSTANTIATE) <= FMI_WARNING && t->result) return p;
    free(p->name);
    return free(p), NULL;
}

static int plain_call(struct proxy *p, int which) {
    talk(p)->a[0] = which;
    return called_for(p, PLAIN);
}
EXPORT void fmi2FreeInstance(struct proxy *p) {
    if (!p) return;
    plain_call(p, FREE);
    free(p->name);
    free(p);
}
EXPORT int fmi2EnterInitializationMode(struct proxy *p) { return plain_call(p, ENTER); }
EXPORT int fmi2ExitInitializationMode(struct proxy *p) { return plain_call(p, EXIT); }
EXPORT int fmi2Terminate(struct proxy *p) { return plain_call(p, TERMINATE); }
EXPORT int fmi2Reset(struct proxy *p) { return plain_call(p, RESET); }
EXPORT int fmi2CancelStep(struct proxy *p) { return plain_call(p, CANCEL); }
EXPORT int fmi2SetDebugLogging(struct proxy *p, int on, size_t n, const char *const categories[]) { return OK; }

EXPORT int fmi2SetupExperiment(struct proxy *p, int tolerance_defined, double tolerance, double start, int stop_defined, double stop) {
    struct talk *t = talk(p);
    t->a[0] = tolerance_defined, t->a[1] = stop_defined;
    t->d[0] = tolerance, t->d[1] = start, t->d[2] = stop;
    return called_for(p, SETUP);
}

EXPORT int fmi2SetReal(struct proxy *p, const unsigned *references, size_t n, const double *values) {
    return ended(p, client_set_real(&p->client, references, n, values));
}
EXPORT int fmi2GetReal(struct proxy *p, const unsigned *references, size_t n, double *values) {
    return ended(p, client_get_real(&p->client, references, n, values));
}
EXPORT int fmi2DoStep(struct proxy *p, double time, double step, int no_set_state) {
    return ended(p, client_do_step(&p->client, time, step, no_set_state));
}

static int too_long(struct proxy *p) {
    p->callbacks.logger(p->callbacks.environment, p->name, FMI_ERROR, "logStatusError", "%s",
                        "more than the memory between this process and Wine holds (16 MB)");
    return FMI_ERROR;
}

static int of_words(struct proxy *p, int command, int kind, const unsigned *references, size_t n, int *values) {
    struct talk *t = talk(p);
    if (n > TALK_ROOM / 8) return too_long(p);
    unsigned *to = (unsigned *)t->data;
    memcpy(to, references, n * sizeof *to);
    if (command == SET_WORDS) memcpy(to + n, values, n * sizeof *values);
    t->a[0] = (int64_t)n, t->a[1] = kind;
    const int status = called_for(p, command);
    if (command == GET_WORDS && status <= FMI_WARNING) memcpy(values, to + n, n * sizeof *values);
    return status;
}
EXPORT int fmi2GetInteger(struct proxy *p, const unsigned *r, size_t n, int *v) { return of_words(p, GET_WORDS, WORDS_INTEGER, r, n, v); }
EXPORT int fmi2GetBoolean(struct proxy *p, const unsigned *r, size_t n, int *v) { return of_words(p, GET_WORDS, WORDS_BOOLEAN, r, n, v); }
EXPORT int fmi2SetInteger(struct proxy *p, const unsigned *r, size_t n, const int *v) { return of_words(p, SET_WORDS, WORDS_INTEGER, r, n, (int *)v); }
EXPORT int fmi2SetBoolean(struct proxy *p, const unsigned *r, size_t n, const int *v) { return of_words(p, SET_WORDS, WORDS_BOOLEAN, r, n, (int *)v); }

EXPORT int fmi2GetString(struct proxy *p, const unsigned *references, size_t n, const char **values) {
    struct talk *t = talk(p);
    if (n > TALK_ROOM / 8) return too_long(p);
    memcpy(t->data, references, n * sizeof *references);
    t->a[0] = (int64_t)n;
    const int status = called_for(p, GET_TEXTS);
    const char *at = (char *)t->data + n * sizeof *references;
    for (size_t k = 0; status <= FMI_WARNING && k < n; ++k, at += strlen(at) + 1) values[k] = at;
    return status;
}
EXPORT int fmi2SetString(struct proxy *p, const unsigned *references, size_t n, const char *const *values) {
    struct talk *t = talk(p);
    size_t bytes = n * sizeof *references;
    for (size_t k = 0; k < n; ++k) bytes += strlen(values[k]) + 1;
    if (bytes > TALK_ROOM) return too_long(p);
    memcpy(t->data, references, n * sizeof *references);
    char *at = (char *)t->data + n * sizeof *references;
    for (size_t k = 0; k < n; ++k, at += strlen(at) + 1) strcpy(at, values[k]);
    t->a[0] = (int64_t)n;
    return called_for(p, SET_TEXTS);
}

EXPORT int fmi2GetFMUstate(struct proxy *p, void **state) {
    talk(p)->a[0] = (int64_t)*state;
    const int status = called_for(p, GET_STATE);
    if (status <= FMI_WARNING) *state = (void *)talk(p)->a[0];
    return status;
}
EXPORT int fmi2SetFMUstate(struct proxy *p, void *state) {
    talk(p)->a[0] = (int64_t)state;
    return called_for(p, SET_STATE);
}
EXPORT int fmi2FreeFMUstate(struct proxy *p, void **state) {
    talk(p)->a[0] = (int64_t)*state;
    *state = NULL;
    return called_for(p, FREE_STATE);
}
EXPORT int fmi2SerializedFMUstateSize(struct proxy *p, void *state, size_t *size) {
    talk(p)->a[0] = (int64_t)state;
    const int status = called_for(p, STATE_SIZE);
    *size = (size_t)talk(p)->a[1];
    return status <= FMI_WARNING && *size > TALK_ROOM ? too_long(p) : status;
}
EXPORT int fmi2SerializeFMUstate(struct proxy *p, void *state, unsigned char *bytes, size_t size) {
    if (size > TALK_ROOM) return too_long(p);
    talk(p)->a[0] = (int64_t)state, talk(p)->a[1] = (int64_t)size;
    const int status = called_for(p, SERIALISE);
    if (status <= FMI_WARNING) memcpy(bytes, talk(p)->data, size);
    return status;
}
EXPORT int fmi2DeSerializeFMUstate(struct proxy *p, const unsigned char *bytes, size_t size, void **state) {
    if (size > TALK_ROOM) return too_long(p);
    memcpy(talk(p)->data, bytes, size);
    talk(p)->a[0] = (int64_t)*state, talk(p)->a[1] = (int64_t)size;
    const int status = called_for(p, DESERIALISE);
    if (status <= FMI_WARNING) *state = (void *)talk(p)->a[0];
    return status;
}

EXPORT int fmi2GetDirectionalDerivative(struct proxy *p, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns,
                                        size_t n_knowns, const double *seed, double *found) {
    struct talk *t = talk(p);
    if ((n_unknowns + n_knowns) > TALK_ROOM / 16) return too_long(p);
    double *values = (double *)t->data;
    unsigned *references = (unsigned *)(values + n_knowns + n_unknowns);
    memcpy(values, seed, n_knowns * sizeof *seed);
    memcpy(references, unknowns, n_unknowns * sizeof *unknowns);
    memcpy(references + n_unknowns, knowns, n_knowns * sizeof *knowns);
    t->a[0] = (int64_t)n_unknowns, t->a[1] = (int64_t)n_knowns;
    const int status = called_for(p, DERIVATIVES);
    if (status <= FMI_WARNING) memcpy(found, values + n_knowns, n_unknowns * sizeof *found);
    return status;
}

static int of_status(struct proxy *p, int type, int kind, void *value, size_t size) {
    talk(p)->a[0] = type, talk(p)->a[1] = kind;
    const int status = called_for(p, STATUS);
    if (status <= FMI_WARNING) memcpy(value, talk(p)->data, size);
    return status;
}
EXPORT int fmi2GetStatus(struct proxy *p, int kind, int *value) { return of_status(p, OF_STATUS, kind, value, sizeof *value); }
EXPORT int fmi2GetRealStatus(struct proxy *p, int kind, double *value) { return of_status(p, OF_REAL, kind, value, sizeof *value); }
EXPORT int fmi2GetIntegerStatus(struct proxy *p, int kind, int *value) { return of_status(p, OF_INTEGER, kind, value, sizeof *value); }
EXPORT int fmi2GetBooleanStatus(struct proxy *p, int kind, int *value) { return of_status(p, OF_BOOLEAN, kind, value, sizeof *value); }

static int unavailable(struct proxy *p, const char *call) {
    p->callbacks.logger(p->callbacks.environment, p->name, FMI_ERROR, "logStatusError", "%s is not passed on to Wine", call);
    return FMI_ERROR;
}
EXPORT int fmi2GetStringStatus(struct proxy *p, int kind, const char **value) { return unavailable(p, "fmi2GetStringStatus"); }
EXPORT int fmi2SetRealInputDerivatives(struct proxy *p, const unsigned *r, size_t n, const int *o, const double *v) {
    return unavailable(p, "fmi2SetRealInputDerivatives");
}
EXPORT int fmi2GetRealOutputDerivatives(struct proxy *p, const unsigned *r, size_t n, const int *o, double *v) {
    return unavailable(p, "fmi2GetRealOutputDerivatives");
}

/* For a reader of libraries: the same questions, asked from Python. */
EXPORT int wine_ask(struct client *client, int command) {
    ((struct talk *)client->box->text)->command = command;
    client->number = client->box->reply; /* an instance may have asked since */
    return mailbox_talk(client);
}
