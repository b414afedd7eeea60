/* A native FMU's model as data: what a compiled one has in tables of C, and its tape, in resources/model.bin
   (fmus/toolchain/native_fmu.py writes it). Each instance reads its own; nothing is shared. */
struct parameter {
    double minimum, maximum;
    int32_t kind, tunable;
};

/* Behind it lie START, PARAMETER, the texts (guid, NAME, RULE) and the tape. */
struct model_header {
    char magic[8];
    uint32_t version, bytes, checksum; /* the checksum (CRC-32) is of all that follows */
    uint32_t names, rules, starts, parameters, text, longest, internal_step;
    unsigned char identity[16];
};

struct model {
    char *bytes;
    const struct model_header *head;
    const double *start;
    const struct parameter *parameter;
    const char *guid, **text; /* names, then rules */
    const void *tape;
};

static void forget(struct model *m) {
    free(m->bytes);
    free(m->text);
}

static int of_hex(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    c |= 32;
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* The path of a file in the folder that a host names by a URI (FMI 2.0) or by a path. */
static char *path_in(const char *resources, const char *file) {
    const int escaped = !strncmp(resources, "file:", 5);
    const char *from = resources + (escaped ? 5 : 0);
    char *path = malloc(strlen(resources) + strlen(file) + 2), *to = path;
    if (!path) return NULL;
    if (escaped && !strncmp(from, "//", 2))
        for (from += 2; *from && *from != '/';) ++from; /* the host, which is this one */
#ifdef _WIN32
    if (escaped && from[0] == '/' && from[1] && from[2] == ':') ++from;
#endif
    for (; *from; ++from) {
        const int high = escaped && *from == '%' ? of_hex(from[1]) : -1, low = high < 0 ? -1 : of_hex(from[2]);
        *to++ = (char)(low < 0 ? *from : 16 * high + low);
        if (low >= 0) from += 2;
    }
    *to = '/';
    strcpy(to + (to == path || to[-1] != '/'), file);
    return path;
}

#ifdef _WIN32
#include <wchar.h>
__declspec(dllimport) int __stdcall MultiByteToWideChar(unsigned, unsigned long, const char *, int, wchar_t *, int);
enum { UTF_8 = 65001, OF_THE_MACHINE = 0, STRICTLY = 8 };
static FILE *opened(const char *path) { /* paths are UTF-8; some hosts give them in the machine's own code */
    for (unsigned code = UTF_8;; code = OF_THE_MACHINE) {
        const unsigned long how = code == UTF_8 ? STRICTLY : 0;
        const int n = MultiByteToWideChar(code, how, path, -1, NULL, 0);
        wchar_t *wide = n > 0 ? malloc((size_t)n * sizeof *wide) : NULL;
        FILE *file = wide && MultiByteToWideChar(code, how, path, -1, wide, n) ? _wfopen(wide, L"rb") : NULL;
        free(wide);
        if (file || code == OF_THE_MACHINE) return file;
    }
}
#else
static FILE *opened(const char *path) { return fopen(path, "rb"); }
#endif

#ifdef MODEL /* the source of an FMU has its model in it */
static const char *load(struct model *m, const char *resources, size_t *size) {
    (void)resources, (void)path_in, (void)opened;
    *size = sizeof MODEL;
    if (!(m->bytes = malloc(*size))) return "there is no memory for it";
    memcpy(m->bytes, MODEL, *size);
    return NULL;
}
#else
static const char *load(struct model *m, const char *resources, size_t *size) {
    char *path = resources ? path_in(resources, "model.bin") : NULL;
    FILE *file = path ? opened(path) : NULL;
    const char *fault = NULL;
    free(path);
    if (!file) return "there is no file model.bin that can be read";
    const long end = fseek(file, 0, SEEK_END) ? -1 : ftell(file);
    *size = end > 0 ? (size_t)end : 0;
    rewind(file);
    if (!(m->bytes = malloc(*size + 1))) fault = "there is no memory for model.bin";
    else if (fread(m->bytes, 1, *size, file) != *size) fault = "model.bin cannot be read";
    fclose(file);
    return fault;
}
#endif

/* Point at the parts of a model that was loaded; says why it is none. */
static const char *lay_out_model(struct model *m, size_t size) {
    const struct model_header *h = m->head = (const struct model_header *)m->bytes;
    if (size < sizeof *h || memcmp(h->magic, "gformodl", 8)) return "model.bin is no model";
    if (h->version != VERSION) return "model.bin is of another version";
    if (h->bytes != size) return "model.bin is not whole";
    const size_t checked = offsetof(struct model_header, names);
    if (h->checksum != crc32((const unsigned char *)m->bytes + checked, size - checked))
        return "the checksum of model.bin differs";
    const uint64_t texts = sizeof *h + 8 * (uint64_t)h->starts + sizeof *m->parameter * (uint64_t)h->parameters;
    const uint64_t tape = texts + h->text, entries = 1 + (uint64_t)h->names + h->rules;
    if (tape >= size || h->text % 8 || !h->text || m->bytes[tape - 1]) return "the sizes in model.bin do not add up";
    m->start = (const double *)(h + 1);
    m->parameter = (const struct parameter *)(m->start + h->starts);
    m->guid = m->bytes + texts;
    m->tape = m->bytes + tape;
    if (!(m->text = malloc(entries * sizeof *m->text))) return "there is no memory for model.bin";
    const char *at = m->guid;
    for (uint64_t k = 0; k < entries; ++k) {
        if (k) m->text[k - 1] = at;
        if (at >= (const char *)m->tape) return "a text of model.bin is missing";
        at += strlen(at) + 1;
    }
    const char *fault = tape_fault(m->tape, size - tape, (int)h->names, (int)h->rules);
    if (fault) return fault;
    const struct sizes *s = &((const struct header *)m->tape)->size;
    if ((uint32_t)s->np != h->parameters || (uint32_t)(s->np + s->nu) != h->starts || h->internal_step >= h->parameters)
        return "its tape is of another model";
    return NULL;
}

static const char *read_model(struct model *m, const char *resources) {
    size_t size = 0;
    const char *fault = load(m, resources, &size);
    return fault ? fault : lay_out_model(m, size);
}

/* From here on sizes and tables are those of an instance s. */
#undef OF
#define OF(w) ((struct tape *)s->work)
enum kind { REAL, INTEGER, BOOLEAN };
static const char *const KIND[] = {"Real", "Integer", "Boolean"};
enum { SHORTEST_TEXT = 640 };
#define TEXT (SHORTEST_TEXT + (s->model.tape ? s->model.head->longest : 0)) /* nothing is known of a model not read */
#define NR ((int)s->model.head->rules)
#define NAME (s->model.text)
#define RULE (s->model.text + s->model.head->names)
#define START (s->model.start)
#define PARAMETER (s->model.parameter)
#define INTERNAL_STEP (s->model.head->internal_step)
#define GUID (s->model.guid)
#define IDENTITY (s->model.head->identity)
#define ROOM (OF(w)->size.slots)
#define OUTPUTS_WAIT (NB > 0) /* a network has thousands that a step does not need */
