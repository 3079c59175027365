/* Data common to all kinds of lanes on a CPU: itineraries as nodes of a tree, starts that are not finite, the last events. */
#define MEMORY 256

/* Data of a trajectory for the driver: the last events, up to a row of a log, and their number when it ended; halved steps, up to a step; hits of a section,
 * samples; what only the driver changes. */
typedef struct {
  Recent event[HISTORY];
  int64_t count, seen, row, steps, hits, kept;
  double shortened;
#if EVENTS
  int64_t kinds[KINDS];
  int8_t letter[SURFACES + 1];
  double motion[MOTION], jumped[HISTORY * N];
#endif
} Past;

/* Whether events may accumulate: intervals shrink like a geometric series, in blocks of some length, or are zero. */
static int may_accumulate(const Past *p) {
  for (int l = 0; l < LAG_COUNT; l++) {
    int lag = LAGS[l];
    double block[BLOCKS] = {0};
    if (p->count < (BLOCKS + 1) * lag) return 0;
    for (int k = 0; k < BLOCKS * lag; k++) block[k / lag] += p->event[(p->count - 1 - k) % HISTORY].interval;
    if (!(block[0] > 0) || shrink_alike(block)) return 1;
  }
  return 0;
}

/* A tree of itineraries, and a cache of nodes by code. */
typedef struct {
  Tree *tree;
  int64_t code[MEMORY];
  int32_t node[MEMORY];
} Words;

/* Modes of a code: base 4 with digits from 1, the last one lowest. */
static __attribute__((noinline)) int32_t walk(Tree *tree, int32_t node, int64_t code) {
  for (int shift = 60; shift >= 0; shift -= 2)
    if (code >> shift & 3) node = tree_child(tree, node, (int)(code >> shift & 3) - 1);
  return node;
}

static int32_t itinerary(Words *words, int32_t base, int64_t code) {
  if (base) return walk(words->tree, base, code);
  int slot = (int)((uint64_t)code * 0x9e3779b97f4a7c15u >> 56);
  if (words->code[slot] != code) {
    words->code[slot] = code;
    words->node[slot] = walk(words->tree, 0, code);
  }
  return words->node[slot];
}

static void refuse(const Batch *b, int64_t i) {
  for (int k = 0; k < ND; k++) b->x[i * ND + k] = b->x0[i * N + k];
  b->t[i] = b->t0;
  b->status[i] = NOT_FINITE;
  b->itinerary[i] = 0;
  memset(b->kinds + i * b->kinds_width, 0, (b->kinds_width - 1) * sizeof(int32_t));
  b->kinds[(i + 1) * b->kinds_width - 1] = 1;
}

