/* Output ----------------------------------------------------------------------------------- */

static void note(Run *r) {
  if (!r->o.dense) return;
  int64_t k = r->out.points++;
  r->out.point_t[k] = r->t;
  memcpy(r->out.point_x + k * r->n, r->x, sizeof(double) * r->n);
}

/* The mode of a step in results. */
static int shown_mode(const Run *r) { return r->s->sets || r->s->rules.discrete ? r->shown : r->mode; }

/* Write a step with polynomials in powers of the time since its start. Where the start is two numbers the polynomials are
 * moved to its rounded value. */
static void note_step(Run *r, const Expansion *e) {
  if (!r->o.dense) return;
  int64_t k = r->out.steps++, stride = r->stride;
  double *c = r->out.coefficients + k * r->n * stride, low = r->t_low;
  r->out.start[k] = r->t;
  r->out.step_mode[k] = shown_mode(r) | (e->end ? IMPLICIT_STEP : 0);
  memcpy(c, e->states, sizeof(double) * r->n * stride);
  if (fabs(low) <= EPSILON * larger(1, time_scale(r))) return;
  for (int i = 0; i < r->s->dimension; i++, c += stride) move_origin(c, r->order, -low, r->order);
}

static void renote(Run *r) {
  if (r->o.dense && r->out.points)
    memcpy(r->out.point_x + (r->out.points - 1) * r->n, r->x, sizeof(double) * r->n);
}

static void enter_segment(Run *r, int mode) {
  Tree *tree = &r->table->tree;
  if (mode == r->segment_mode) return;
  if (r->o.dense) { r->segment_mode = mode; return; } /* that of its steps is written */
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

/* Samples at the times from the present one to less than that after a step. */
static void sample_step(Run *r, const Expansion *e, double dt) {
  double *x = r->vector, end = time_after(r, dt), ignored;
  while (r->kept < r->room && r->times[r->kept] < end) {
    double s = r->times[r->kept] - r->t - r->t_low;
    for (int i = 0; i < r->s->dimension; i++) x[i] = horner(e->states + (int64_t)i * r->stride, r->order, s, &ignored);
    sample(r, r->times[r->kept], x);
  }
}

static void count_hit(Run *r, int kind, int guard, int index, int side, const double *x) {
  const Options *o = &r->o;
  if (!(o->hit_kinds >> kind & 1) || !o->hit_named[guard * o->hit_width + index]) return;
  if ((o->hit_side && side != o->hit_side) || r->t <= r->begun.high) return; /* the start does not count */
  r->hits++;
  if (r->hits <= o->hit_skip || (r->hits - o->hit_skip) % o->hit_every) return;
  /* Before the jumps of the instant, or after them. */
  Instant *i = &r->instant;
  int is_last = o->hit_count && r->hits >= o->hit_skip + o->hit_every * o->hit_count;
  sample(r, r->t, o->hit_after ? r->x : i->running && i->jumps > (kind == RESET) ? i->arrived : x);
  if (o->hit_after && i->running) { i->sampled = r->kept; i->is_last = is_last; }
  else if (is_last) finish(r, STOPPED, SAMPLED, (int)o->hit_count);
}

/* Record an event. ``x`` is the state at it, the present one unless the event changed it; ``guard`` a row of the mode
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
    r->out.event_guard[k] = guard < 0 ? -1 : ((shown_index(r) << 2) + r->guard.side + 1) * 16 + r->guard.kind;
    if (r->out.event_motion) write_motion(r, r->out.event_motion + k * r->s->rules.width);
  }
  if (r->o.hit_kinds && guard >= 0) count_hit(r, kind, r->guard.kind, shown_index(r), r->guard.side, x);
  if (r->o.hit_kinds && guard < 0) count_hit(r, kind, IMPACT_GUARD, element(r, r->m)->shown, 0, x); /* impacts that accumulated */
  if (kind == END || kind == STOP) return;
  remember(r, kind, guard, x);
  if (r->instant.running) return; /* at the end of the instant */
  see_limit(r);
  if (r->event_count >= r->o.max_events) finish(r, TOO_MANY_EVENTS, NO_REASON, 0);
}
