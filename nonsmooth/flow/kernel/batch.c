/* Batches on this processor: groups of W lanes that are refilled, itineraries as nodes of a tree. After lanes.c. */
#define GROUPS MOST
#define OFTEN 16 /* starts for each lane from which on there are several groups */

/* A batch, and how far it is. */
struct Work {
  const Batch *b;
  const Options *o;
  const Core *core;
  Words words;
  int64_t next;
  int alive, groups;
};

INLINE const Options *limits(const Work *w) { return w->o; }

static __attribute__((noinline)) void shorten_codes(Lanes *s, Work *w) {
  for EACH(l, s->code >= LONG_CODE) {
    s->base[l] = walk(w->words.tree, s->base[l], LANE_I(s->code, l));
    LANE_I(s->code, l) = 0;
  }
}

/* Loading and storing -------------------------------------------------------------------------- */

static void store(Lanes *s, Work *w, int l, int status) {
  const Batch *b = w->b;
  int64_t i = s->index[l];
  w->alive--;
  b->totals[0] += LANE_I(s->steps, l);
  b->totals[1] += LANE_I(s->events, l);
  b->status[i] = (int8_t)status;
  UNROLL for (int k = 0; k < ND; k++) b->x[i * ND + k] = LANE(s->x[k], l);
  b->t[i] = LANE(s->t, l);
  b->itinerary[i] = itinerary(&w->words, s->base[l], LANE_I(s->code, l));
  int32_t *kinds = b->kinds + i * SIMPLE_KINDS;
  UNROLL for (int k = 0; k < LAST_KIND; k++) kinds[k] = (int32_t)LANE_I(s->kinds[k], l);
  kinds[LAST_KIND] = status == REACHED_END;
}

/* Put the next start into a lane; 0 if there is none. Vectors are written whole: what is written in parts
 * cannot be read soon. */
static int load(Lanes *s, Work *w, int l, I mine) {
  const Batch *b = w->b;
  if (w->next >= b->count) return 0;
  int64_t i = w->next++;
  UNROLL for (int k = 0; k < N; k++) s->x[k] = SELECT(mine, BC(b->x0[i * N + k]), s->x[k]);
  if (b->p_stride) {
    double q[NQ];
    prepare(b->p + i * b->p_stride, q);
    for (int k = 0; k < NQ; k++) s->q[k] = SELECT(mine, BC(q[k]), s->q[k]);
  }
  s->index[l] = i;
  s->base[l] = 0;
  s->past[l].count = s->past[l].steps = 0;
  s->past[l].row = s->row;
  s->past[l].shortened = 0;
  w->alive++;
  return 1;
}

static I refill(Lanes *s, Work *w) {
  I fresh = {0}, number;
  UNROLL for (int l = 0; l < W; l++) number[l] = l;
  for EACH(l, ~s->live) {
    I mine = number == (int64_t)l;
    if (!load(s, w, (int)l, mine)) break;
    fresh |= mine;
  }
  T wrong = BC(0);
  UNROLL for (int k = 0; k < N; k++) wrong += s->x[k] - s->x[k];
  I refused = fresh & (wrong != 0);
  for EACH(l, refused) {
    refuse(w->b, s->index[l]);
    w->alive--;
  }
  fresh &= ~refused;
  s->t = SELECT(fresh, BC(w->b->t0), s->t);
  s->since = SELECT(fresh, BC(0), s->since);
  s->length = SELECT(fresh, BC(0), s->length);
  s->live |= fresh;
  s->code &= ~fresh;
  s->steps &= ~fresh;
  s->events &= ~fresh;
  s->entered &= ~fresh;
  s->drop &= ~fresh;
  UNROLL for (int k = 0; k < LAST_KIND; k++) s->kinds[k] &= ~fresh;
  return fresh;
}

INLINE void keep_event(const Lanes *s, Work *w, int kind, I which) {
  const Batch *b = w->b;
  if (w->o->at_kind != kind || !b->at_x) return;
  I now = which & (s->kinds[kind] == w->o->at_count);
  for EACH(l, now) {
    b->at_t[s->index[l]] = LANE(s->t, l);
    UNROLL for (int i = 0; i < ND; i++) b->at_x[s->index[l] * ND + i] = LANE(s->x[i], l);
  }
}

/* Steps of the driver ------------------------------------------------------------------------ */

/* A lane as the driver takes and gives it back. */
typedef struct {
  Suspended m;
  double x[N];
  int64_t kinds[KINDS];
  int8_t letter[1], side[STOPS + 1];
} Packed;

static void point_to(Packed *a, Past *past) {
  a->m.x = a->x;
  a->m.kinds = a->kinds;
  a->m.letter = a->letter;
  a->m.side = a->side;
  a->m.past = past->event;
}

static void pack(const Lanes *s, Work *w, int l, Packed *a) {
  Suspended *m = &a->m;
  const Past *past = &s->past[l];
  recall(s, l);
  UNROLL for (int i = 0; i < N; i++) a->x[i] = LANE(s->x[i], l);
  for (int k = 0; k < LAST_KIND; k++) a->kinds[k] = LANE_I(s->kinds[k], l);
  for (int j = 0; j < STOPS; j++) a->side[j] = LANE_I(s->above_stop[j], l) ? 1 : -1;
  a->letter[0] = LANE_I(s->slides, l) ? 0 : LANE_I(s->above, l) ? 1 : -1;
  m->t = LANE(s->t, l);
  m->since = LANE(s->since, l);
  m->length = LANE(s->length, l);
  m->steps = LANE_I(s->steps, l);
  m->shortened = larger(0, past->shortened - 0.2 * (double)(m->steps - past->steps));
  m->events = LANE_I(s->events, l);
  m->segment_steps = m->steps - LANE_I(s->entered, l);
  m->history = past->count;
  m->drop = (int32_t)LANE_I(s->drop, l);
  m->itinerary = itinerary(&w->words, s->base[l], LANE_I(s->code, l));
}

static void unpack(Lanes *s, int l, const Packed *a) {
  const Suspended *m = &a->m;
  Past *past = &s->past[l];
  UNROLL for (int i = 0; i < N; i++) LANE(s->x[i], l) = a->x[i];
  for (int k = 0; k < LAST_KIND; k++) LANE_I(s->kinds[k], l) = a->kinds[k];
  for (int j = 0; j < STOPS; j++) LANE_I(s->above_stop[j], l) = -(int64_t)(a->side[j] > 0);
  LANE_I(s->slides, l) = -(int64_t)(M > 0 && a->letter[0] == 0);
  LANE_I(s->above, l) = -(int64_t)(a->letter[0] > 0);
  LANE(s->lambda, l) = a->letter[0] > 0 ? 1 : -1;
  LANE(s->t, l) = m->t;
  LANE(s->since, l) = m->since;
  LANE(s->length, l) = m->length;
  LANE_I(s->steps, l) = past->steps = m->steps;
  past->shortened = m->shortened;
  LANE_I(s->events, l) = m->events;
  LANE_I(s->entered, l) = m->steps - m->segment_steps;
  past->count = m->history;
  past->row = s->row;
  LANE_I(s->drop, l) = m->drop;
  s->base[l] = m->itinerary;
  LANE_I(s->code, l) = 0;
}

/* A lane goes on with what the driver gives back, or is free: the driver has stored where the run ended. */
static void take_back(Lanes *s, Work *w, int l, const Packed *a) {
  w->b->totals[2]++;
  if (a->m.status == RUNNING) { unpack(s, l, a); return; }
  LANE_I(s->live, l) = 0;
  w->alive--;
}

static __attribute__((noinline)) void begin_elsewhere(Lanes *s, Work *w, I which) {
  Packed a;
  for EACH(l, which) {
    point_to(&a, &s->past[l]);
    w->core->begin(w->core->run, w->b, w->o, s->index[l], &a.m);
    take_back(s, w, (int)l, &a);
  }
}

static __attribute__((noinline)) void step_elsewhere(Lanes *s, Work *w, I which) {
  Packed a;
  for EACH(l, which) {
    point_to(&a, &s->past[l]);
    pack(s, w, (int)l, &a);
    w->core->step(w->core->run, w->b, w->o, s->index[l], &a.m);
    take_back(s, w, (int)l, &a);
  }
}

/* Lanes whose step is made by the driver although it may be clear. */
INLINE I by_chance(const Lanes *s, const Work *w) {
  I which = NONE;
  if (!w->core->random) return which;
  for (int l = 0; l < W; l++) {
    uint64_t z = ((uint64_t)(s->index[l] + 1) << 32) + (uint64_t)(LANE_I(s->steps, l) * 2654435761LL + w->core->random);
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    LANE_I(which, l) = -(int64_t)(z >> 63);
  }
  return which;
}

typedef struct { Lanes lanes[GROUPS]; Step steps[GROUPS]; Past past[GROUPS][W]; Log log[GROUPS]; Work work; int begun; } Many;

int64_t many_size(void) { return sizeof(Many); }

/* The parts of a step one after the other for all groups: a part's text is read once for them all, and what
 * one group waits for another one's work fills. */
#define PART(NAME, CALL) \
  static __attribute__((noinline)) void NAME(Lanes *groups, Work *w, Step *e, int n) { \
    for (int i = 0; i < n; i++) { Lanes *s = &groups[i]; (void)w; if (any(s->live)) { CALL; } } \
  }
PART(expand_all, expand_step(s, w, &e[i]))
PART(sort_all, sort_step(s, &e[i]))
PART(take_all, I unclear = take_step(s, w, &e[i]); if (any(unclear)) step_elsewhere(s, w, unclear))
static __attribute__((noinline)) void hit_all(Lanes *s, Step *e) { first_hits(GROUPS, s, e); }

static void begin_all(Many *many, const Batch *b, const Options *o, Tree *tree, const Core *core) {
  Work *w = &many->work;
  double q[NQ];
  w->b = b;
  w->o = o;
  w->core = core;
  w->words.tree = tree;
  w->groups = b->count >= OFTEN * GROUPS * W ? GROUPS : 1 + (int)(b->count / (OFTEN * W));
  prepare(b->p, q);
  for (int i = 0; i < GROUPS; i++) {
    many->lanes[i].size = o->atol / o->rtol;
    many->lanes[i].past = many->past[i];
    many->lanes[i].log = &many->log[i];
    for (int k = 0; k < NQ; k++) many->lanes[i].q[k] = BC(q[k]);
  }
  many->begun = 1;
}

/* Run a batch, ``budget`` steps of it at most; whether something is left for another call. ``many``
 * is zero before the first, and aligned like a vector. */
int run_many(Many *many, const Batch *b, const Options *o, Tree *tree, const Core *core, int64_t budget) {
  Lanes *s = many->lanes;
  Step *e = many->steps;
  Work *w = &many->work;
  if (!many->begun) begin_all(many, b, o, tree, core);
  for (;;) {
    while (w->alive < w->groups * W && w->next < b->count)
      for (int i = 0; i < w->groups; i++) {
        I fresh = refill(&s[i], w);
        if (any(fresh)) begin(&s[i], w, fresh);
      }
    if (!w->alive) return 0;
    if ((budget -= w->groups) < 0) return 1;
    expand_all(s, w, e, w->groups);
    sort_all(s, w, e, w->groups);
    hit_all(s, e);
    take_all(s, w, e, w->groups);
  }
}
