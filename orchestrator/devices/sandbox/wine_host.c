/* The program that runs a Windows library under Wine, and answers for it: host.exe MAILBOX PARENT. */

static struct mailbox *box;
static HMODULE library;

static struct said *said(void) { return (struct said *)box->log; }

static void keep(int status, const char *category, const char *text) {
    struct said *s = said();
    const int room = (int)sizeof s->records - s->bytes;
    ++s->count;
    if (room > 16) {
        const int n = snprintf(s->records + s->bytes, (size_t)room, "%d%c%.100s%c%.3000s", status, 0, category, 0, text) + 1;
        s->bytes += n < room ? n : room;
        s->records[s->bytes - 1] = 0;
    }
}

/* Wine ends a program that fails with a number alone. */
static LONG WINAPI failed(EXCEPTION_POINTERS *what) {
    const DWORD code = what->ExceptionRecord->ExceptionCode;
    const char *words = code == EXCEPTION_ACCESS_VIOLATION     ? "an access to memory that is not its own"
                        : code == EXCEPTION_STACK_OVERFLOW     ? "a stack that is full"
                        : code == EXCEPTION_INT_DIVIDE_BY_ZERO ? "a division by zero"
                        : code == EXCEPTION_ILLEGAL_INSTRUCTION ? "an instruction that the processor does not have"
                                                                : "an exception";
    char text[200];
    snprintf(text, sizeof text, "crash of the Windows library: %s (0x%08lX)", words, (unsigned long)code);
    keep(FMI_FATAL, "logStatusFatal", text);
    ExitProcess(70);
    return EXCEPTION_EXECUTE_HANDLER;
}

static void logger(void *environment, const char *name, int status, const char *category, const char *format, ...) {
    char text[3200];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format ? format : "", arguments);
    va_end(arguments);
    keep(status, category ? category : "", text);
}

static struct {
    void *logger, *allocate, *release, *finished, *environment;
} callbacks = {logger, calloc, free, NULL, NULL};

static void *function(const char *name) { return (void *)GetProcAddress(library, name); }

static void *component;

/* A function of the FMU; one that it does not have says so. */
static void *needed(const char *name) {
    void *found = function(name);
    if (!found) {
        char text[200];
        snprintf(text, sizeof text, "its binary for Windows has no function %s", name);
        keep(FMI_ERROR, "logStatusError", text);
    }
    return found;
}

#define ASK(type, name, ...) \
    do { \
        type f = (type)needed(name); \
        t->result = f ? f(__VA_ARGS__) : FMI_ERROR; \
    } while (0)

static HMODULE loaded(const char *path) {
    static WCHAR wide[4096];
    if (!MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 4096)) return NULL;
    for (WCHAR *c = wide; *c; ++c)
        if (*c == L'/') *c = L'\\';
    return LoadLibraryExW(wide, NULL, LOAD_WITH_ALTERED_SEARCH_PATH);
}

static void instantiate(struct talk *t) {
    const char *name = (char *)t->data, *guid = name + strlen(name) + 1, *resources = guid + strlen(guid) + 1;
    void *(*f)(const char *, int, const char *, const char *, const void *, int, int) = needed("fmi2Instantiate");
    component = f ? f(name, 1, guid, resources, &callbacks, (int)t->a[0], (int)t->a[1]) : NULL;
    t->result = component != NULL;
}

typedef int (*plain)(void *);
typedef int (*words)(void *, const unsigned *, size_t, int *);
typedef int (*texts)(void *, const unsigned *, size_t, const char **);
typedef int (*setup)(void *, int, double, double, int, double);
typedef int (*state)(void *, void **);
typedef int (*one_state)(void *, void *);
typedef int (*derivatives)(void *, const unsigned *, size_t, const unsigned *, size_t, const double *, double *);
typedef int (*status_of)(void *, int, void *);

static void of_texts(struct talk *t, int set) {
    const size_t n = (size_t)t->a[0];
    unsigned *references = (unsigned *)t->data;
    char *at = (char *)(references + n);
    const char **rows = calloc(n + 1, sizeof *rows);
    for (size_t k = 0; set && k < n; ++k, at += strlen(at) + 1) rows[k] = at;
    ASK(texts, set ? "fmi2SetString" : "fmi2GetString", component, references, n, rows);
    char *end = (char *)t->data + TALK_ROOM;
    for (size_t k = 0; !set && t->result <= FMI_WARNING && k < n; ++k) {
        const size_t size = strlen(rows[k] ? rows[k] : "") + 1;
        if ((size_t)(end - at) < size) {
            t->result = FMI_ERROR;
            break;
        }
        memcpy(at, rows[k] ? rows[k] : "", size);
        at += size;
    }
    free(rows);
}

static void answer(struct talk *t) {
    static const char *const WORD[] = {"fmi2GetInteger", "fmi2GetBoolean", "fmi2SetInteger", "fmi2SetBoolean"};
    static const char *const STATE_OF[] = {"fmi2GetStatus", "fmi2GetRealStatus", "fmi2GetIntegerStatus", "fmi2GetBooleanStatus"};
    void *held = (void *)t->a[0];
    switch (t->command) {
        case LOAD:
            if (library) FreeLibrary(library); /* the one before, of which no instance is left */
            component = NULL;
            library = loaded((char *)t->data);
            t->result = (int64_t)library;
            t->a[0] = library ? 0 : (int64_t)GetLastError();
            return;
        case SYMBOL: t->result = (int64_t)function((char *)t->data); return;
        case CALL: t->result = ((int64_t(*)(void *))t->a[0])((void *)t->a[1]); return;
        case READ: memcpy(t->data, (void *)t->a[0], (size_t)t->a[1]); return;
        case WRITE: memcpy((void *)t->a[0], t->data, (size_t)t->a[1]); return;
        case ALLOCATE: t->result = (int64_t)calloc(1, (size_t)t->a[0]); return;
        case INSTANTIATE: instantiate(t); return;
        case PLAIN: ASK(plain, PLAIN_CALL[t->a[0]], component); return;
        case SETUP:
            ASK(setup, "fmi2SetupExperiment", component, (int)t->a[0], t->d[0], t->d[1], (int)t->a[1], t->d[2]);
            return;
        case GET_WORDS:
        case SET_WORDS: {
            unsigned *references = (unsigned *)t->data;
            const size_t n = (size_t)t->a[0];
            ASK(words, WORD[t->a[1] + (t->command == SET_WORDS ? 2 : 0)], component, references, n, (int *)(references + n));
            return;
        }
        case GET_TEXTS: of_texts(t, 0); return;
        case SET_TEXTS: of_texts(t, 1); return;
        case GET_STATE:
            ASK(state, "fmi2GetFMUstate", component, &held);
            t->a[0] = (int64_t)held;
            return;
        case SET_STATE: ASK(one_state, "fmi2SetFMUstate", component, held); return;
        case FREE_STATE: ASK(state, "fmi2FreeFMUstate", component, &held); return;
        case STATE_SIZE: {
            size_t size = 0;
            int (*f)(void *, void *, size_t *) = needed("fmi2SerializedFMUstateSize");
            t->result = f ? f(component, held, &size) : FMI_ERROR;
            t->a[1] = (int64_t)size;
            return;
        }
        case SERIALISE: {
            int (*f)(void *, void *, void *, size_t) = needed("fmi2SerializeFMUstate");
            t->result = f ? f(component, held, t->data, (size_t)t->a[1]) : FMI_ERROR;
            return;
        }
        case DESERIALISE: {
            int (*f)(void *, const void *, size_t, void **) = needed("fmi2DeSerializeFMUstate");
            t->result = f ? f(component, t->data, (size_t)t->a[1], &held) : FMI_ERROR;
            t->a[0] = (int64_t)held;
            return;
        }
        case DERIVATIVES: {
            const size_t rows = (size_t)t->a[0], columns = (size_t)t->a[1];
            double *seed = (double *)t->data, *found = seed + columns;
            unsigned *unknowns = (unsigned *)(found + rows);
            ASK(derivatives, "fmi2GetDirectionalDerivative", component, unknowns, rows, unknowns + rows, columns, seed, found);
            return;
        }
        case STATUS:
            ASK(status_of, STATE_OF[t->a[0]], component, (int)t->a[1], (void *)t->data);
            return;
    }
}

static void *mapped(const char *path) {
    static WCHAR wide[4096];
    MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 4096);
    HANDLE file = CreateFileW(wide, GENERIC_READ | GENERIC_WRITE, FILE_SHARE_READ | FILE_SHARE_WRITE, NULL, OPEN_EXISTING, 0, NULL);
    HANDLE mapping = file == INVALID_HANDLE_VALUE ? NULL : CreateFileMappingA(file, NULL, PAGE_READWRITE, 0, 0, NULL);
    return mapping ? MapViewOfFile(mapping, FILE_MAP_WRITE, 0, 0, sizeof(struct mailbox)) : NULL;
}

int main(int count, char **given) {
    if (count < 3 || !(box = mapped(given[1]))) return 71;
    SetErrorMode(SEM_FAILCRITICALERRORS | SEM_NOGPFAULTERRORBOX);
    SetUnhandledExceptionFilter(failed);
    const int64_t parent = atoll(given[2]);
    for (;;) {
        void *set = component ? function("fmi2SetReal") : NULL, *get = component ? function("fmi2GetReal") : NULL;
        void *step = component ? function("fmi2DoStep") : NULL;
        if (!mailbox_serve(box, parent, component, (get_set)set, (get_set)get, (do_step)step)) return 0;
        answer((struct talk *)box->text);
        mailbox_answer(box, OK);
    }
}
