/* The lanes' side of a GPU: each thread makes or reads starts, runs them one after the other, and writes their ends.
 * After lanes.c. Numbers are counted from 0 over the whole call; arrays hold those from ``first`` on.
 */

/* Where starts come from: rows; axes whose last runs fastest, of a length or 0 for a single number; a box. */
enum { ROWS_OF_STATES, GRID, BOX };

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
  int32_t *status, *kinds, *steps;
  int64_t *code;
  double *at_x, *at_t;
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
  int64_t place = 0, before = 0, length = g->lengths[k];
  if (length) {
    place = *left % length;
    *left /= length;
  }
  for (int j = 0; j < k; j++) before += g->lengths[j] ? g->lengths[j] : 1;
  return g->values[before + place];
}

static inline void store(Lanes *s, Work *w, int, int status) {
  const Results *out = &w->out;
  int64_t i = s->index.v;
  w->alive = 0;
  UNROLL for (int k = 0; k < ND; k++) out->x[i * ND + k] = s->x[k].v;
  out->t[i] = s->t.v;
  out->status[i] = status;
  out->code[i] = s->code.v;
  UNROLL for (int k = 0; k < LAST_KIND; k++) out->kinds[i * SIMPLE_KINDS + k] = (int32_t)s->kinds[k].v;
  out->kinds[i * SIMPLE_KINDS + LAST_KIND] = status == REACHED_END;
  out->steps[i] = (int32_t)s->steps.v;
}

/* More modes than a number holds. */
static inline void shorten_codes(Lanes *s, Work *w) { finish_lanes(s, w, I(-1), HAND_OVER); }

static inline void begin_elsewhere(Lanes *s, Work *w, I which) { finish_lanes(s, w, which, HAND_OVER); }
INLINE I by_chance(const Lanes *, const Work *) { return NONE; }

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
  w->alive = 1;
  if (w->out.at_x) {
    w->out.at_t[i] = NAN;
    UNROLL for (int k = 0; k < ND; k++) w->out.at_x[i * ND + k] = NAN;
  }
  if (!any(wrong == 0)) {
    finish_lanes(s, w, s->live, NOT_FINITE);
    w->out.kinds[i * SIMPLE_KINDS + LAST_KIND] = 1;
  }
  return 1;
}

static inline void step(Lanes *s, Work *w) {
  Step e;
  expand_step(s, w, &e);
  sort_step(s, &e);
  first_hits(1, s, &e);
  I unclear = take_step(s, w, &e);
  finish_lanes(s, w, unclear, HAND_OVER);
}

/* A thread whose run has ended takes its next start at once: its neighbours wait for that, and all make their step
 * together. */
static inline void run_all(Work *w) {
  Lanes s;
  s.size = w->o.atol / w->o.rtol;
  w->alive = 0;
  for (;;) {
    while (!w->alive) {
      if (!load(&s, w)) return;
      if (w->alive) begin(&s, w, s.live);
    }
    step(&s, w);
  }
}

/* Numbers are of 64 bits each, so that what launches this needs no structure. */
KERNEL BOUNDS trajectories(
    int64_t count, int64_t first, int64_t kind, int64_t seed, const double *values, const int64_t *lengths,
    const double *q, int64_t q_stride, double t0, double t_end, double rtol, double atol, double max_step,
    int64_t max_steps, int64_t max_events, int64_t at_kind, int64_t at_count, double *x, double *t, int32_t *status,
    int32_t *kinds, int32_t *steps, int64_t *code, double *at_x, double *at_t) {
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
  w.out = {x, t, status, kinds, steps, code, at_x, at_t};
  w.next = (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
  w.stride = (int64_t)gridDim.x * blockDim.x;
  run_all(&w);
}

/* What the parameters alone decide, for each row of them. */
KERNEL parameters(int64_t count, int64_t size, const double *p, double *q) {
  int64_t stride = (int64_t)gridDim.x * blockDim.x;
  for (int64_t i = (int64_t)blockIdx.x * blockDim.x + threadIdx.x; i < count; i += stride)
    prepare(p + i * size, q + i * NQ);
}

/* Results reduced where they are ------------------------------------------------------------------ */

typedef unsigned long long Count;

/* Count a code in a table of a power of two places, 0 for an empty one; 0 if there is no room. */
static inline int counted(int64_t code, int64_t size, Count *keys, Count *counts) {
  Count key = (Count)code + 1, at = key * 0x9e3779b97f4a7c15ULL >> 20;
  for (int64_t tried = 0; tried < size; tried++, at++) {
    int64_t place = (int64_t)(at & (Count)(size - 1));
    Count found = atomicCAS(keys + place, 0ULL, key);
    if (found != 0 && found != key) continue;
    atomicAdd(counts + place, 1ULL);
    return 1;
  }
  return 0;
}

/* Statuses and itineraries counted; states and times of runs that are complete summed, their squares too, by each
 * thread for itself, and put into bins. Those of ``rest``, which are
 * ``left``, are another's. */
KERNEL outcomes(int64_t count, const double *x, const double *t, const int32_t *status, const int64_t *code,
                int64_t bins, const double *low, const double *high, Count *histogram, double *sums, int64_t size,
                Count *keys, Count *counts, Count *statuses, Count *left, int64_t *rest) {
  int64_t thread = (int64_t)blockIdx.x * blockDim.x + threadIdx.x, stride = (int64_t)gridDim.x * blockDim.x;
  double *own = sums + thread * 2 * (ND + 1);
  for (int k = 0; k < 2 * (ND + 1); k++) own[k] = 0;
  for (int64_t i = thread; i < count; i += stride) {
    if (status[i] == HAND_OVER || !counted(code[i], size, keys, counts)) {
      rest[atomicAdd(left, 1ULL)] = i;
      continue;
    }
    atomicAdd(statuses + status[i], 1ULL);
    if (status[i] != REACHED_END && status[i] != STOPPED) continue;
    for (int k = 0; k <= ND; k++) {
      double v = k < ND ? x[i * ND + k] : t[i];
      own[2 * k] += v;
      own[2 * k + 1] += v * v;
      double place = product(sum(v, -low[k]), (double)bins / sum(high[k], -low[k]));
      if (v == high[k]) place = (double)(bins - 1);
      if (place >= 0 && place < (double)bins) atomicAdd(histogram + k * bins + (int64_t)place, 1ULL);
    }
  }
}
