/* Lanes on a GPU: each thread makes or reads starts, runs them one after the other, and writes their ends.
 * After lanes.c. Numbers count from 0 over the whole call; arrays begin with number ``first``.
 */

/* Sources of starts: rows; axes, the last one fastest, with their lengths or 0 for a single number; a box; records of runs
 * to be continued. */
enum { ROWS_OF_STATES, GRID, BOX, RECORDS };

/* Words of a record: Left, the states, the sides of stops. */
#define WORDS ((int)(sizeof(Left) / 8) + N + STOPS)

typedef unsigned long long Count;

struct Given {
  int64_t count, first, kind;
  uint64_t seed;
  const double *values;
  const int64_t *lengths;
  const double *q;
  int64_t q_stride;
  double t0;
};

struct Results {
  double *x, *t;
  int8_t *status;
  int32_t *kinds, *steps;
  int64_t *code;
  double *at_x, *at_t;
  int64_t *left; /* records of the runs with the status FALL_BACK */
  Count *left_count;
};

struct Work {
  Options o;
  Given given;
  Results out;
  int64_t next, stride;
  int alive;
};

INLINE const Options *limits(const Work *w) { return &w->o; }

/* Output ``number`` of SplitMix64. */
static inline uint64_t split_mix(uint64_t seed, uint64_t number) {
  uint64_t z = seed + (number + 1) * 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

/* State k of start i; ``left`` is what remains of a grid's number, to be read from the last state on. */
static inline double start_of(const Given *g, int64_t i, int k, int64_t *left) {
  if (g->kind == ROWS_OF_STATES) return g->values[i * ND + k];
  if (g->kind == BOX) {
    double low = g->values[k], part = (double)(split_mix(g->seed, (uint64_t)(ND * (g->first + i) + k)) >> 11);
    return sum(low, product(sum(g->values[ND + k], -low), part * (1.0 / 9007199254740992.0)));
  }
  int64_t slot = 0, before = 0, length = g->lengths[k];
  if (length) {
    slot = *left % length;
    *left /= length;
  }
  for (int j = 0; j < k; j++) before += g->lengths[j] ? g->lengths[j] : 1;
  return g->values[before + slot];
}

static inline void store(Lanes *s, Work *w, int, int status) {
  const Results *out = &w->out;
  int64_t i = s->index.v;
  w->alive = 0;
  UNROLL for (int k = 0; k < ND; k++) out->x[i * ND + k] = s->x[k].v;
  out->t[i] = s->t.v;
  out->status[i] = (int8_t)status;
  out->code[i] = s->code.v;
  UNROLL for (int k = 0; k < LAST_KIND; k++) out->kinds[i * SIMPLE_KINDS + k] = (int32_t)s->kinds[k].v;
  out->kinds[i * SIMPLE_KINDS + LAST_KIND] = status == REACHED_END;
  out->steps[i] = (int32_t)s->steps.v;
}

/* Keep the first modes only: drop a mode that would shift FROZEN out. */
static inline void shorten_codes(Lanes *s, Work *) {
  if (!(s->code.v & FROZEN)) s->code = (s->code >> 2) | FROZEN;
}

/* Fields of a record, numbers and counts, with the names of those of lanes. */
#define RECORDED(F, G) F(t) F(since) F(length) F(shortest) G(steps) G(events) G(entered) G(shrinking) G(code) G(drop)

static inline void write_record(const Lanes *s, int begun, int64_t *record) {
  Left *to = (Left *)record;
  double *x = (double *)(to + 1);
  int64_t *above = (int64_t *)(x + N);
#define WRITE(name) to->name = s->name.v;
  RECORDED(WRITE, WRITE)
  to->index = s->index.v;
  to->letter = s->slides.v ? 0 : s->above.v ? 1 : -1;
  to->begun = begun;
  UNROLL for (int k = 0; k < LAST_KIND; k++) to->kinds[k] = s->kinds[k].v;
  UNROLL for (int k = 0; k < N; k++) x[k] = s->x[k].v;
  UNROLL for (int k = 0; k < STOPS; k++) above[k] = s->above_stop[k].v;
}

static inline void read_record(Lanes *s, const Work *w, const int64_t *record, int64_t index) {
  const Left *from = (const Left *)record;
  const double *x = (const double *)(from + 1);
  const int64_t *above = (const int64_t *)(x + N);
  s->index = I(index);
  s->q = (const T *)(w->given.q + index * w->given.q_stride);
#define READ_T(name) s->name = BC(from->name);
#define READ_I(name) s->name = I(from->name);
  RECORDED(READ_T, READ_I)
  s->slides = I(-(int64_t)(M > 0 && from->letter == 0));
  s->above = I(-(int64_t)(from->letter > 0));
  UNROLL for (int k = 0; k < LAST_KIND; k++) s->kinds[k] = I(from->kinds[k]);
  UNROLL for (int k = 0; k < N; k++) s->x[k] = BC(x[k]);
  UNROLL for (int k = 0; k < STOPS; k++) s->above_stop[k] = I(above[k]);
  set_lambda(s);
  s->live = I(-1);
}

/* Leave the run to the driver. */
OUTLINED void leave(Lanes *s, Work *w, int begun) {
  write_record(s, begun, w->out.left + (int64_t)atomicAdd(w->out.left_count, 1ULL) * WORDS);
  w->out.status[s->index.v] = FALL_BACK;
  w->alive = 0;
  s->live = NONE;
}

static inline void begin_elsewhere(Lanes *s, Work *w, I which) {
  if (any(which)) leave(s, w, 0);
}

/* Leave runs at random, for tests. */
INLINE I by_chance(const Lanes *s, const Work *) {
  return RANDOM ? I(-(int64_t)(split_mix(RANDOM, (uint64_t)(bits_of(s->x[0].v) ^ bits_of(s->t.v) ^ s->steps.v)) >> 63)) : NONE;
}

INLINE void count(Lanes *s, Work *w, int kind, I which) {
  s->kinds[kind] -= which;
  s->events -= which;
  if (w->o.at_kind != kind || !w->out.at_x || !any(which & (s->kinds[kind] == w->o.at_count))) return;
  int64_t i = s->index.v;
  w->out.at_t[i] = s->t.v;
  UNROLL for (int k = 0; k < ND; k++) w->out.at_x[i * ND + k] = s->x[k].v;
}

/* Put the next start into the lane; 0 if there is none. */
static inline int load(Lanes *s, Work *w) {
  const Given *g = &w->given;
  if (w->next >= g->count) return 0;
  int64_t i = w->next, left = g->first + i;
  w->next += w->stride;
  w->alive = 1;
  if (w->out.at_x) {
    w->out.at_t[i] = NAN;
    UNROLL for (int k = 0; k < ND; k++) w->out.at_x[i * ND + k] = NAN;
  }
  if (g->kind == RECORDS) {
    read_record(s, w, (const int64_t *)g->values + i * WORDS, i);
    return 1;
  }
  T wrong = BC(0);
  UNROLL for (int k = ND - 1; k >= 0; k--) {
    s->x[k] = BC(start_of(g, i, k, &left));
    wrong += s->x[k] - s->x[k];
  }
  if (TIMED) s->x[N - 1] = BC(g->t0);
  s->q = (const T *)(g->q + i * g->q_stride);
  s->t = BC(g->t0);
  s->since = BC(0);
  s->shortest = BC(1e-3);
  s->length = BC(0);
  s->code = s->steps = s->entered = s->events = s->shrinking = s->drop = s->slides = s->above = I(0);
  s->lambda = BC(0);
  UNROLL for (int k = 0; k < LAST_KIND; k++) s->kinds[k] = I(0);
  UNROLL for (int k = 0; k < STOPS; k++) s->above_stop[k] = I(0);
  s->index = I(i);
  s->live = I(-1);
  if (any(wrong == 0)) begin(s, w, s->live);
  else {
    finish_lanes(s, w, s->live, NOT_FINITE);
    w->out.kinds[i * SIMPLE_KINDS + LAST_KIND] = 1;
  }
  return 1;
}

static inline void step(Lanes *s, Work *w) {
  Step e;
  expand_step(s, w, &e, AWAY);
  sort_step(s, &e, AWAY);
  first_hits(1, s, &e);
  if (any(take_step(s, w, &e, AWAY))) leave(s, w, 1);
}

/* A thread whose run has ended takes its next start at once, while its neighbours wait, so that all make their steps
 * together. A run that exceeds the ``budget`` of a launch continues in the next one, from ``own``. */
static inline void run_all(Work *w, int64_t budget, int64_t *own, Count *running) {
  Lanes s;
  s.size = w->o.atol / w->o.rtol;
  w->alive = 0;
  if (w->next < 0) {
    w->next = own[0];
    w->alive = (int)own[1];
    if (w->alive) read_record(&s, w, own + 2, ((const Left *)(own + 2))->index);
  }
  for (;; budget--) {
    while (!w->alive && load(&s, w)) continue;
    if (!ANY_OF_GROUP(w->alive) || budget <= 0) break;
    if (w->alive) step(&s, w);
  }
  own[0] = w->next;
  own[1] = w->alive;
  if (w->alive) write_record(&s, 1, own + 2);
  if (w->alive || w->next < w->given.count) atomicAdd(running, 1ULL);
}

/* All arguments have 64 bits, so that the launch needs no structure. ``own``: a record and two more words for each thread,
 * read unless this launch is the first; ``counts``: records left, and threads that continue in a further launch. */
KERNEL BOUNDS trajectories(
    int64_t count, int64_t first, int64_t kind, int64_t seed, const double *values, const int64_t *lengths,
    const double *q, int64_t q_stride, double t0, double t_end, double rtol, double atol, double max_step,
    int64_t max_steps, int64_t max_events, int64_t at_kind, int64_t at_count, double *x, double *t, int8_t *status,
    int32_t *kinds, int32_t *steps, int64_t *code, double *at_x, double *at_t, int64_t *left, int64_t *own,
    Count *counts, int64_t is_first, int64_t budget) {
  Work w;
  w.o.t_end = t_end;
  w.o.rtol = rtol;
  w.o.atol = atol;
  w.o.max_step = max_step;
  w.o.max_steps = max_steps;
  w.o.max_events = max_events;
  w.o.at_kind = (int32_t)at_kind;
  w.o.at_count = at_count;
  w.given = {count, first, kind, (uint64_t)seed, values, lengths, q, q_stride, t0};
  w.out = {x, t, status, kinds, steps, code, at_x, at_t, left, counts};
  int64_t thread = (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
  w.next = is_first ? thread : -1;
  w.stride = (int64_t)gridDim.x * blockDim.x;
  run_all(&w, budget, own + thread * (WORDS + 2), counts + 1);
}

/* Evaluate the nodes of parameters only, for each row of parameters. */
KERNEL parameters(int64_t count, int64_t size, const double *p, double *q) {
  int64_t stride = (int64_t)gridDim.x * blockDim.x;
  for (int64_t i = (int64_t)blockIdx.x * blockDim.x + threadIdx.x; i < count; i += stride)
    prepare(p + i * size, q + i * NQ);
}

/* Reductions on the device ------------------------------------------------------------------------ */

/* Index of a code in a hash table of a power of two entries, 0 for an empty one; -1 if there is no room. */
static inline int64_t slot_of(int64_t code, int64_t size, Count *keys) {
  Count key = (Count)code + 1, at = key * 0x9e3779b97f4a7c15ULL >> 20;
  for (int64_t tried = 0; tried < size && tried < LONGEST_SEARCH; tried++, at++) {
    int64_t slot = (int64_t)(at & (Count)(size - 1));
    Count found = keys[slot] == key ? key : atomicCAS(keys + slot, 0ULL, key);
    if (found == 0 || found == key) return slot;
  }
  return -1;
}

/* Replace itineraries by indices of the table; count steps and events of runs that ended on the device. */
KERNEL numbered(int64_t count, const int8_t *status, const int32_t *kinds, const int32_t *steps, const int64_t *code,
                int64_t size, Count *keys, int32_t *slot, Count *totals) {
  int64_t stride = (int64_t)gridDim.x * blockDim.x, all_steps = 0, all_events = 0;
  for (int64_t i = (int64_t)blockIdx.x * blockDim.x + threadIdx.x; i < count; i += stride) {
    slot[i] = 0;
    if (status[i] == FALL_BACK) continue;
    slot[i] = (int32_t)slot_of(code[i], size, keys);
    all_steps += steps[i];
    for (int k = 0; k < LAST_KIND; k++) all_events += kinds[i * SIMPLE_KINDS + k];
  }
  atomicAdd(totals, (Count)all_steps);
  atomicAdd(totals + 1, (Count)all_events);
}

/* Count statuses and itineraries; each thread sums states and times of complete runs and their squares, and bins them. Runs
 * whose itinerary has no room in the table are listed in ``rest``, ``rest_count`` of them. */
KERNEL outcomes(int64_t count, const double *x, const double *t, const int8_t *status, const int64_t *code,
                int64_t bins, const double *low, const double *high, Count *histogram, double *sums, int64_t size,
                Count *keys, Count *counts, Count *statuses, Count *rest_count, int64_t *rest) {
  int64_t thread = (int64_t)blockIdx.x * blockDim.x + threadIdx.x, stride = (int64_t)gridDim.x * blockDim.x;
  double *own = sums + thread * 2 * (ND + 1);
  for (int64_t i = thread; i < count; i += stride) {
    if (status[i] == FALL_BACK) continue;
    int64_t slot = slot_of(code[i], size, keys);
    if (slot < 0) {
      rest[atomicAdd(rest_count, 1ULL)] = i;
      continue;
    }
    atomicAdd(counts + slot, 1ULL);
    atomicAdd(statuses + status[i], 1ULL);
    if (status[i] != REACHED_END && status[i] != STOPPED) continue;
    for (int k = 0; k <= ND; k++) {
      double v = k < ND ? x[i * ND + k] : t[i];
      own[2 * k] += v;
      own[2 * k + 1] += v * v;
      double at = product(sum(v, -low[k]), (double)bins / sum(high[k], -low[k]));
      if (v == high[k]) at = (double)(bins - 1);
      if (at >= 0 && at < (double)bins) atomicAdd(histogram + k * bins + (int64_t)at, 1ULL);
    }
  }
}
