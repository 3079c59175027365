/* Batches on this processor: groups of W lanes that are refilled, itineraries as nodes of a tree. After lanes.c. */
#define GROUPS MOST
#define OFTEN 16 /* starts for each lane from which on there are several groups */

INLINE const Options *limits(const Work *w) { return w->o; }

static __attribute__((noinline)) void shorten_codes(Lanes *s, Work *w) {
  for EACH(l, s->code >= LONG_CODE) {
    LANE_I(s->base, l) = walk(w->words.tree, LANE_I(s->base, l), LANE_I(s->code, l));
    LANE_I(s->code, l) = 0;
  }
}

/* Loading and storing -------------------------------------------------------------------------- */

static void store(Lanes *s, Work *w, int l, int status) {
  w->alive--;
  keep_end(s, w, l, status);
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
  LANE_I(s->index, l) = i;
  LANE_I(s->base, l) = 0;
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
    refuse(w->b, LANE_I(s->index, l));
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

/* Steps of the driver ------------------------------------------------------------------------ */

static Past *past_of(const Lanes *s, Work *w, int l) { (void)w; return &s->past[l]; }

static void write_mode(const Lanes *s, Work *w, int l, Suspended *m) {
  (void)w;
  recall(s, l);
  m->letter[0] = LANE_I(s->slides, l) ? 0 : LANE_I(s->above, l) ? 1 : -1;
  m->drop = (int32_t)LANE_I(s->drop, l);
}

static void read_mode(Lanes *s, Work *w, int l, const Suspended *m) {
  (void)w;
  s->past[l].row = s->row;
  LANE_I(s->slides, l) = -(int64_t)(M > 0 && m->letter[0] == 0);
  LANE_I(s->above, l) = -(int64_t)(m->letter[0] > 0);
  LANE(s->lambda, l) = m->letter[0] > 0 ? 1 : -1;
  LANE_I(s->drop, l) = m->drop;
}

static __attribute__((noinline)) void go_elsewhere(Lanes *s, Work *w, I which, int begun) {
  for EACH(l, which)
    if (!driven(s, w, (int)l, begun)) {
      LANE_I(s->live, l) = 0;
      w->alive--;
    }
}
static void begin_elsewhere(Lanes *s, Work *w, I which) { go_elsewhere(s, w, which, 0); }

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
PART(take_all, I unclear = take_step(s, w, &e[i]); if (any(unclear)) go_elsewhere(s, w, unclear, 1))
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
