/* Exchange of runs between lanes and driver on a CPU, and the ends of runs. */
#if SET
#define WAITING (4 * GROUPS * W)

/* A trajectory on its way to another pool, in words. */
#define WORDS ((int)(__builtin_offsetof(Lanes, size) / sizeof(T)))
typedef struct { int64_t word[WORDS]; } Traveller;
#else
#define WAITING (GROUPS * W)
#endif

/* A batch and its progress. */
struct Work {
  const Batch *b;
  const Options *o;
  const Core *core;
  Words words;
  int64_t next, budget; /* steps until the end of a call */
  int groups, alive[POOLS], waiting[POOLS]; /* trajectories in lanes of a pool, and those that wait for one */
  Past past[WAITING];
#if SET
  int column, spares, spare[WAITING]; /* words of a trajectory; pasts that are free */
  Traveller queue[POOLS][WAITING];
#endif
};

/* A lane in the form of the driver. */
typedef struct {
  Suspended m;
  double x[N], unknowns[LETTERS];
  int64_t kinds[KINDS];
  int8_t letter[LETTERS], side[STOPS + 1];
} Packed;

static void point_to(Packed *a, Past *past) {
  a->m.x = a->x;
  a->m.unknowns = a->unknowns;
#if EVENTS
  a->m.kinds = past->kinds;
  a->m.motion = past->motion;
  a->m.jumped = past->jumped;
#else
  a->m.kinds = a->kinds;
  a->m.motion = 0;
#endif
  a->m.letter = a->letter;
  a->m.side = a->side;
  a->m.past = past->event;
  a->m.near = a->m.drop = a->m.arrived = 0;
  a->m.driven = SURFACES > 0;
}

/* Set the time of a run's next sample; infinite if there is none. */
static void await_sample(Lanes *s, const Work *w, int l) {
  const Batch *b = w->b;
  int64_t kept = past_of(s, l)->kept;
  LANE(s->due, l) = b->times && kept < b->room ? b->times[LANE_I(s->index, l) * b->times_stride + kept] : INFINITY;
}

/* Store the sample that is due: the polynomials of the states, of a degree, at a time since the start of the step. */
static void keep_sample(Lanes *s, Work *w, int l, const T *series, int degree, double at) {
  int64_t row = LANE_I(s->index, l) * w->b->room + past_of(s, l)->kept++;
  w->b->sample_t[row] = LANE(s->due, l);
  for (int i = 0; i < ND; i++, series += degree + 1) {
    double x = LANE(series[degree], l);
    for (int k = degree - 1; k >= 0; k--) x = x * at + LANE(series[k], l);
    w->b->sample_x[row * ND + i] = x;
  }
  await_sample(s, w, l);
}

/* Samples at the times from the start of a step to less than its end. */
static __attribute__((noinline)) void keep_samples(Lanes *s, Work *w, const Step *e, I which) {
  T end = e->t + e->dt;
  for EACH(l, which)
    while (LANE(s->due, l) < LANE(end, l)) keep_sample(s, w, l, e->c[0], P, LANE(s->due, l) - LANE(e->t, l));
}

#if EVENTS
/* Lanes with a sample at their time, to rounding: the driver decides whether it is before an event there. */
static I sampled_there(const Lanes *s, const Work *w, I which) {
  if (!w->b->times) return NONE;
  for EACH(l, which) {
    const double *time = w->b->times + LANE_I(s->index, l) * w->b->times_stride;
    double t = LANE(s->t, l), near = NEAR * larger(1, fabs(t));
    int64_t k = past_of(s, l)->kept;
    while (k < w->b->room && time[k] < t - near) k++;
    if (k == w->b->room || time[k] > t + near) LANE_I(which, l) = 0;
  }
  return which;
}
#endif

#if !SET
/* Lanes whose next event may be the last that is sampled: the driver ends their runs. */
static I ends_sampling(const Lanes *s, const Work *w, I which) {
  const Options *o = w->o;
  if (!o->hit_count) return NONE;
  for EACH(l, which) if (past_of(s, l)->hits + 1 < o->hit_skip + o->hit_every * o->hit_count) LANE_I(which, l) = 0;
  return which;
}

/* Samples of the lanes whose event is at the section; ``above``: the side from which they came. As count_hit. */
static void keep_hits(Lanes *s, Work *w, int kind, int guard, I which, I above) {
  const Options *o = w->o;
  if (!(o->hit_kinds >> kind & 1) || !o->hit_named[guard * o->hit_width]) return;
  for EACH(l, which) {
    Past *past = past_of(s, l);
    if ((o->hit_side && (LANE_I(above, l) ? 1 : -1) != o->hit_side) || LANE(s->t, l) <= w->b->t0) continue;
    if (++past->hits <= o->hit_skip || (past->hits - o->hit_skip) % o->hit_every || past->kept >= w->b->room) continue;
    LANE(s->due, l) = LANE(s->t, l);
    keep_sample(s, w, l, s->x, 0, 0);
  }
}
#endif

static void pack(const Lanes *s, Work *w, int l, Packed *a) {
  Suspended *m = &a->m;
  const Past *past = past_of(s, l);
  write_mode(s, l, m);
  UNROLL for (int i = 0; i < N; i++) a->x[i] = LANE(s->x[i], l);
  for (int k = 0; k < LAST_KIND; k++) m->kinds[k] = LANE_I(s->kinds[k], l);
  for (int j = 0; j < STOPS; j++) a->side[j] = LANE_I(s->above_stop[j], l) ? 1 : -1;
  for (int j = 0; EVENTS && j < STOPS; j++) if (LANE_I(s->from_zero[j], l)) a->side[j] *= 2;
  m->t = LANE(s->t, l);
  m->since = LANE(s->since, l);
  m->length = LANE(s->length, l);
  m->steps = LANE_I(s->steps, l);
  m->shortened = larger(0, past->shortened - 0.2 * (double)(m->steps - past->steps));
  m->events = LANE_I(s->events, l);
  m->segment_steps = m->steps - LANE_I(s->entered, l);
  m->history = past->count;
  m->seen = past->seen;
  if (EVENTS) m->arrived = (int32_t)LANE_I(s->arrived, l);
  m->hits = past->hits;
  m->kept = past->kept;
  m->itinerary = itinerary(&w->words, (int32_t)LANE_I(s->base, l), LANE_I(s->code, l));
}

/* The multipliers of surfaces are parameters of a lane. */
static void prepare_mode(Lanes *s, const Work *w, int l, const int8_t *letter) {
  double p[PARAMETERS + SURFACES + 1], q[NQ];
  memcpy(p, w->b->p + LANE_I(s->index, l) * w->b->p_stride, sizeof(double) * PARAMETERS);
  for (int k = 0; k < SURFACES; k++) p[PARAMETERS + k] = letter[k];
  prepare(p, q);
  for (int k = 0; k < NQ; k++) LANE(s->q[k], l) = q[k];
}

/* Returns the pool where a lane continues. */
static int unpack(Lanes *s, const Work *w, int l, const Packed *a) {
  const Suspended *m = &a->m;
  Past *past = past_of(s, l);
  UNROLL for (int i = 0; i < N; i++) LANE(s->x[i], l) = a->x[i];
  for (int k = 0; k < LAST_KIND; k++) LANE_I(s->kinds[k], l) = m->kinds[k];
  for (int j = 0; j < STOPS; j++) LANE_I(s->above_stop[j], l) = -(int64_t)(a->side[j] > 0);
  for (int j = 0; EVENTS && j < STOPS; j++) LANE_I(s->from_zero[j], l) = -(int64_t)(abs(a->side[j]) == 2);
  LANE(s->t, l) = m->t;
  LANE(s->since, l) = m->since;
  LANE(s->length, l) = m->length;
  LANE_I(s->steps, l) = past->steps = m->steps;
  past->shortened = m->shortened;
  LANE_I(s->events, l) = m->events;
  LANE_I(s->entered, l) = m->steps - m->segment_steps;
  past->count = m->history;
  past->seen = m->seen;
  past->hits = m->hits;
  past->kept = m->kept;
  await_sample(s, w, l);
  LANE_I(s->base, l) = m->itinerary;
  LANE_I(s->code, l) = 0;
  if (SURFACES) prepare_mode(s, w, l, m->letter);
  return read_mode(s, l, m);
}

static void keep_end(Lanes *s, Work *w, int l, int status) {
  const Batch *b = w->b;
  while (!SET && LANE(s->due, l) <= LANE(s->t, l)) keep_sample(s, w, l, s->x, 0, 0);
  int64_t i = LANE_I(s->index, l);
  b->totals[0] += LANE_I(s->steps, l);
  b->totals[1] += LANE_I(s->events, l);
  b->status[i] = (int8_t)status;
  UNROLL for (int k = 0; k < ND; k++) b->x[i * ND + k] = LANE(s->x[k], l);
  b->t[i] = LANE(s->t, l);
  b->itinerary[i] = itinerary(&w->words, (int32_t)LANE_I(s->base, l), LANE_I(s->code, l));
  int32_t *kinds = b->kinds + i * b->kinds_width;
  UNROLL for (int k = 0; k < LAST_KIND; k++) kinds[k] = (int32_t)LANE_I(s->kinds[k], l);
#if EVENTS
  for (int64_t k = LAST_KIND; k < b->kinds_width - 1; k++) kinds[k] = (int32_t)past_of(s, l)->kinds[k];
#endif
  kinds[b->kinds_width - 1] = status == REACHED_END;
}

INLINE void keep_event(const Lanes *s, Work *w, int kind, I which) {
  const Batch *b = w->b;
  if (w->o->at_kind != kind || !b->at_x) return;
  I now = which & (s->kinds[kind] == w->o->at_count);
  for EACH(l, now) {
    int64_t i = LANE_I(s->index, l);
    b->at_t[i] = LANE(s->t, l);
    UNROLL for (int k = 0; k < ND; k++) b->at_x[i * ND + k] = LANE(s->x[k], l);
  }
}

INLINE void count(Lanes *s, Work *w, int kind, I which) {
  s->kinds[kind] -= which;
  s->events -= which;
  keep_event(s, w, kind, which);
}

/* Lanes whose step is made by the driver although it may be clear. */
INLINE I by_chance(const Lanes *s, const Work *w) {
  I which = NONE;
  if (!w->core->random) return which;
  for (int l = 0; l < W; l++) {
    uint64_t z = ((uint64_t)(LANE_I(s->index, l) + 1) << 32) + (uint64_t)(LANE_I(s->steps, l) * 2654435761LL + w->core->random);
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    LANE_I(which, l) = -(int64_t)(z >> 63);
  }
  return which;
}

/* The driver begins the run of a lane, or makes its step. Returns the pool where the run continues, from this lane; negative
 * if the driver stored its end. */
static __attribute__((noinline)) int driven(Lanes *s, Work *w, int l, int begun) {
  Packed a;
  point_to(&a, past_of(s, l));
  a.m.steps = 0;
  if (begun) pack(s, w, l, &a);
  w->budget += a.m.steps;
  (begun ? w->core->step : w->core->begin)(w->core->run, w->b, w->o, LANE_I(s->index, l), &a.m);
  w->b->totals[2]++;
  w->budget -= a.m.steps;
  return a.m.status == RUNNING ? unpack(s, w, l, &a) : -1;
}
