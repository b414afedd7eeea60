/* A controller alone: nothing lies around it. */
static int circuit_start(struct instance *s) { return (void)s, OK; }
static int circuit_advance(struct instance *s, double from, double to) { return (void)s, (void)from, (void)to, OK; }
static void circuit_before(struct instance *s, double time) { (void)s, (void)time; }
static void circuit_after(struct instance *s) { (void)s; }
static void circuit_refresh(struct instance *s, double time) { (void)s, (void)time; }
static int circuit_check(struct instance *s) { return (void)s, OK; }
