/* Output ----------------------------------------------------------------------------------- */

static void note(Run *r) {
  if (!r->o.dense) return;
  int64_t k = r->out.points++;
  r->out.point_t[k] = r->t;
  memcpy(r->out.point_x + k * r->n, r->x, sizeof(double) * r->n);
}

static void renote(Run *r) {
  if (r->o.dense && r->out.points)
    memcpy(r->out.point_x + (r->out.points - 1) * r->n, r->x, sizeof(double) * r->n);
}

static void enter_segment(Run *r, int mode) {
  Tree *tree = &r->table->tree;
  if (mode == r->segment_mode) return;
  if (r->segment_steps == 0) r->itinerary = tree->node[r->itinerary].parent;
  if (r->itinerary < 0) r->itinerary = 0;
  r->itinerary = tree_child(tree, r->itinerary, mode);
  r->segment_mode = mode;
  r->segment_steps = 0;
}

/* Samples: nonsmooth/flow/section.py */
static void sample(Run *r, double t, const double *x) {
  if (r->kept >= r->room) return;
  r->sample_t[r->kept] = t;
  memcpy(r->sample_x + r->kept++ * r->s->dimension, x, r->s->dimension * sizeof(double));
}

/* Samples at the times from the present one to less than that plus dt. */
static void sample_step(Run *r, const Expansion *e, double dt) {
  double *x = r->vector, ignored;
  while (r->kept < r->room && r->times[r->kept] < r->t + dt) {
    double s = r->times[r->kept] - r->t;
    for (int i = 0; i < r->s->dimension; i++) x[i] = horner(e->states + (int64_t)i * r->stride, r->order, s, &ignored);
    sample(r, r->times[r->kept], x);
  }
}

static void count_hit(Run *r, int kind, int guard, int index, int side, const double *x) {
  const Options *o = &r->o;
  if (!(o->hit_kinds >> kind & 1) || !o->hit_named[guard * o->hit_width + index]) return;
  if ((o->hit_side && side != o->hit_side) || r->t <= r->begun + AT_END * larger(1, fabs(r->begun))) return;
  r->hits++;
  if (r->hits <= o->hit_skip || (r->hits - o->hit_skip) % o->hit_every) return;
  sample(r, r->t, o->hit_after ? r->x : x);
  if (o->hit_count && r->hits >= o->hit_skip + o->hit_every * o->hit_count)
    finish(r, STOPPED, SAMPLED, (int)o->hit_count);
}

static void limit_of_events(Run *r);

/* ``x`` is the state at the event, the present one unless the event changed it; ``guard`` a row of the mode
 * before, or -1. */
static void event(Run *r, int kind, int before, int guard, const double *x) {
  r->kinds[kind]++;
  r->event_count++;
  if (kind == r->o.at_kind && r->kinds[kind] == r->o.at_count) {
    r->at_t = r->t;
    memcpy(r->at_x, x, sizeof(double) * r->n);
  }
  if (r->o.dense) {
    int64_t k = r->out.events++;
    r->out.event_kind[k] = kind;
    r->out.event_t[k] = r->t;
    memcpy(r->out.event_x + k * r->n, x, sizeof(double) * r->n);
    memcpy(r->out.event_after_x + k * r->n, r->x, sizeof(double) * r->n);
    r->out.event_before[k] = before;
    r->out.event_after[k] = r->mode;
    r->out.event_guard[k] = guard;
  }
  if (r->o.hit_kinds && guard >= 0) count_hit(r, kind, r->met.kind, r->met.index, r->met.side, x);
  if (r->o.hit_kinds && guard < 0) count_hit(r, kind, IMPACT_GUARD, 0, 0, x); /* impacts that accumulated */
  if (kind == END || kind == STOP) return;
  int at = r->history++ % HISTORY;
  r->interval[at] = r->t - r->last_event;
  r->kind[at] = kind;
  r->pattern[at] = (((int64_t)kind * 4096 + guard + 1) << 40) + ((int64_t)before << 20) + r->mode;
  r->last_event = r->t;
  limit_of_events(r);
  if (r->event_count >= r->o.max_events) finish(r, TOO_MANY_EVENTS, NO_REASON, 0);
}

/* nonsmooth/flow/reference/driver.py */
static double interval_back(const Run *r, int back) { return r->interval[(r->history - back) % HISTORY]; }
static int64_t pattern_back(const Run *r, int back) { return r->pattern[(r->history - back) % HISTORY]; }

/* Time left until events accumulate; -1 if they do not (yet). */
static double remaining_time(const Run *r) {
  if (r->history > AT_ONCE) {
    int all_zero = 1;
    for (int k = 1; k <= AT_ONCE; k++) all_zero &= interval_back(r, k) == 0;
    if (all_zero) return 0;
  }
  for (int l = 0; l < LAG_COUNT; l++) {
    int lag = LAGS[l], need = BLOCKS * lag, same = 1;
    if (r->history < need + lag) return -1;
    for (int k = 1; k <= need && same; k++) same = pattern_back(r, k) == pattern_back(r, k + lag);
    if (!same) continue;
    double block[BLOCKS], least = INFINITY, low = INFINITY, high = 0, ratio = 0;
    for (int b = 0; b < BLOCKS; b++) {
      block[b] = 0;
      for (int k = 0; k < lag; k++) block[b] += interval_back(r, need - b * lag - k);
      least = fmin(least, block[b]);
    }
    if (!(least > 0)) continue;
    for (int b = 1; b < BLOCKS; b++) {
      ratio = block[b] / block[b - 1];
      low = fmin(low, ratio);
      high = fmax(high, ratio);
    }
    if (!(high < SHRINKS && high - low <= SPREAD * (1 - ratio))) continue;
    double left = block[BLOCKS - 1] * ratio / (1 - ratio);
    if (left < REMAINING * (r->t - r->begun)) return left;
  }
  return -1;
}

static int come_to_rest(Run *r, double left);

static void limit_of_events(Run *r) {
  double left = remaining_time(r);
  if (left < 0 || (r->status == RUNNING && come_to_rest(r, left))) return;
  r->limit = r->t + left;
  finish(r, ACCUMULATION, NO_REASON, 0);
}
