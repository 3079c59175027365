/* Batches on this processor: groups of W lanes in pools, refilled; itineraries as nodes of a tree. After lanes.c. */
#define OFTEN 16 /* starts per lane above which there are several groups */

INLINE const Options *limits(const Work *w) { return w->o; }

static __attribute__((noinline)) void shorten_codes(Lanes *s, Work *w) {
  for EACH(l, s->code >= LONG_CODE) {
    LANE_I(s->base, l) = walk(w->words.tree, LANE_I(s->base, l), LANE_I(s->code, l));
    LANE_I(s->code, l) = 0;
  }
}

/* Loading and storing -------------------------------------------------------------------------- */

/* The run of a lane has ended. */
static void release_lane(Lanes *s, Work *w, int l) {
  w->alive[s->pool]--;
#if SET
  w->spare[w->spares++] = (int)LANE_I(s->own, l);
#endif
}

static void store(Lanes *s, Work *w, int l, int status) {
  release_lane(s, w, l);
  keep_end(s, w, l, status);
}

/* Put the next start into a lane; 0 if there is none. Vectors are written whole: partial writes delay the next read. */
static int load(Lanes *s, Work *w, int l, I mine) {
  const Batch *b = w->b;
  if (w->next >= b->count) return 0;
  int64_t i = w->next++;
  UNROLL for (int k = 0; k < N; k++) s->x[k] = SELECT(mine, BC(b->x0[i * N + k]), s->x[k]);
  if (b->p_stride && !SURFACES) {
    double q[NQ];
    prepare(b->p + i * b->p_stride, q);
    for (int k = 0; k < NQ; k++) s->q[k] = SELECT(mine, BC(q[k]), s->q[k]);
  }
  LANE_I(s->index, l) = i;
  LANE_I(s->base, l) = 0;
#if SET
  LANE_I(s->own, l) = w->spare[--w->spares];
#endif
  Past *past = past_of(s, l);
  past->count = past->seen = past->steps = past->hits = past->kept = 0;
  await_sample(s, w, l);
  past->row = s->row;
  past->shortened = 0;
  w->alive[AWAY]++;
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
    release_lane(s, w, (int)l);
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
  UNROLL for (int k = 0; k < LAST_KIND; k++) s->kinds[k] &= ~fresh;
  return fresh;
}

#if SET
/* The lanes ``which`` wait for another pool. */
static void send(Lanes *s, Work *w, I which, int to) {
  for EACH(l, which) {
    Traveller *one = &w->queue[to][w->waiting[to]++];
    for (int j = 0; j < w->column; j++) one->word[j] = LANE_I(((I *)s)[j], l);
    LANE_I(s->live, l) = 0;
    w->alive[s->pool]--;
  }
}

static void receive(Lanes *s, Work *w) {
  for EACH(l, ~s->live) {
    if (!w->waiting[s->pool]) return;
    const Traveller *one = &w->queue[s->pool][--w->waiting[s->pool]];
    for (int j = 0; j < w->column; j++) LANE_I(((I *)s)[j], l) = one->word[j];
    w->alive[s->pool]++;
  }
}
#endif

static __attribute__((noinline)) void go_elsewhere(Lanes *s, Work *w, I which, int begun) {
  for EACH(l, which) {
    int to = driven(s, w, (int)l, begun);
    if (to < 0) {
      release_lane(s, w, (int)l);
      LANE_I(s->live, l) = 0;
    }
#if SET
    else if (to != s->pool) {
      I one = {0};
      LANE_I(one, l) = -1;
      send(s, w, one, to);
    }
#endif
  }
}
static void begin_elsewhere(Lanes *s, Work *w, I which) { go_elsewhere(s, w, which, 0); }

typedef struct { Lanes lanes[POOLS][GROUPS]; Step steps[GROUPS]; Log log[SET ? 1 : GROUPS]; Work work; int begun; } Many;

int64_t many_size(void) { return sizeof(Many); }

/* Each part of a step for all groups in turn: its instructions are loaded once, and one group computes while another
 * waits. */
#define PART(NAME, CALL) \
  static __attribute__((noinline)) void NAME(Lanes *groups, Work *w, Step *e, int n) { \
    for (int i = 0; i < n; i++) { Lanes *s = &groups[i]; (void)w; if (any(s->live)) { CALL; } } \
  }
#define ELSEWHERE(CALL) I unclear = CALL; if (any(unclear)) go_elsewhere(s, w, unclear, 1)
#define STEPS(NAME, MODE) \
  PART(expand_##NAME, expand_step(s, w, &e[i], MODE)) \
  PART(take_##NAME, ELSEWHERE(take_step(s, w, &e[i], MODE)))
PART(sort_all, sort_step(s, &e[i], s->pool))
static __attribute__((noinline)) void hit_all(Lanes *s, Step *e, int n) {
  for (int i = 0; i < n; i += MOST) first_hits(MOST, s + i, e + i);
}
STEPS(away, AWAY)
typedef void (*Part)(Lanes *, Work *, Step *, int);
#if SET
STEPS(on, ON)
STEPS(going, GOING)
PART(near_all, ELSEWHERE(come_near(s, w, &e[i])))
static const Part EXPAND[] = {expand_away, expand_on, expand_going}, TAKE[] = {take_away, take_on, take_going};
#else
static const Part EXPAND[] = {expand_away}, TAKE[] = {take_away};
#endif

static void begin_all(Many *many, const Batch *b, const Options *o, Tree *tree, const Core *core) {
  Work *w = &many->work;
  double q[NQ];
  w->b = b;
  w->o = o;
  w->core = core;
  w->words.tree = tree;
  w->groups = b->count >= OFTEN * GROUPS * W ? GROUPS : 1 + (int)(b->count / (OFTEN * W));
  if (!SURFACES) prepare(b->p, q);
  for (int i = 0; i < POOLS * GROUPS; i++) {
    Lanes *s = &many->lanes[0][i];
    s->size = o->atol / o->rtol;
    s->pool = i / GROUPS;
    s->past = SET ? w->past : w->past + i * W;
    s->log = &many->log[SET ? 0 : i];
    for (int k = 0; k < NQ && !SURFACES; k++) s->q[k] = BC(q[k]);
  }
#if SET
  w->column = WORDS - (b->p_stride ? 0 : NQ);
  for (int i = 0; i < WAITING; i++) w->spare[w->spares++] = i;
#endif
  many->begun = 1;
}

/* The pool whose lanes make a step: the last one with enough lanes. */
static int chosen(const Work *w) {
  for (int pool = POOLS - 1; pool >= AWAY; pool--) if (w->alive[pool] + w->waiting[pool] >= w->groups * W) return pool;
  if (w->next < w->b->count) return AWAY;
  for (int pool = AWAY; pool < POOLS; pool++) if (w->alive[pool] + w->waiting[pool]) return pool;
  return -1;
}

/* Run a batch for at most ``budget`` steps; whether another call is needed. ``many`` is zero before the first call, and
 * aligned like a vector. */
int run_many(Many *many, const Batch *b, const Options *o, Tree *tree, const Core *core, int64_t budget) {
  Work *w = &many->work;
  Step *e = many->steps;
  if (!many->begun) begin_all(many, b, o, tree, core);
  w->budget = budget;
  for (;;) {
    int pool = chosen(w);
    if (pool < 0) return 0;
    Lanes *s = many->lanes[pool];
#if SET
    for (int i = 0; i < w->groups && w->waiting[pool]; i++) receive(&s[i], w);
#endif
    if (pool == AWAY && w->alive[AWAY] < w->groups * W && w->next < b->count) {
      for (int i = 0; i < w->groups; i++) {
        I fresh = refill(&s[i], w);
        if (any(fresh)) begin(&s[i], w, fresh);
      }
      if (w->budget < 0) return 1;
      continue;
    }
    if ((w->budget -= w->groups) < 0) return 1;
#if SET
    if (pool == NEAR_SET) { near_all(s, w, e, w->groups); continue; }
#endif
    EXPAND[pool](s, w, e, w->groups);
    sort_all(s, w, e, w->groups);
    hit_all(s, e, w->groups);
    TAKE[pool](s, w, e, w->groups);
  }
}
