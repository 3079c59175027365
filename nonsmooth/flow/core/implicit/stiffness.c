/* Choice of implicit steps: where a decay rate limits Taylor steps and an implicit step costs less. */

static int can_collocate(const Run *r) {
  return r->o.method != METHOD_TAYLOR && !r->s->sets && !r->has_roots && r->n <= MOST_STATES;
}

static void set_known(Implicit *m, int mode, int8_t known) {
  if (mode >= m->modes) {
    int32_t room = 2 * mode + 16;
    int8_t *more = realloc(m->known, room);
    if (!more) return;
    memset(more + m->modes, 0, room - m->modes);
    m->known = more;
    m->modes = room;
  }
  m->known[mode] = known;
}

/* Whether the next step is implicit. The first of a leg is not: its guards have known zeros. */
static int is_implicit(Run *r) {
  Implicit *m = r->implicit;
  if (r->since <= 0 || !can_collocate(r)) return 0;
  if (r->o.method == METHOD_STIFF && !r->s->implicit) { r->wants_program = 1; return 0; }
  if (r->o.method == METHOD_STIFF && !m && begin_implicit(r)) m = r->implicit;
  if (!m || !(r->o.method == METHOD_STIFF || (r->mode < m->modes && m->known[r->mode]))) return 0;
  if (m->leg != r->event_count) {
    m->leg = r->event_count;
    begin_lengths(&m->c, r->length, 0);
    m->idle = 0;
  }
  return 1;
}

/* Operations of a Taylor step over those of an implicit one. */
static double cost_ratio(const Run *r) {
  double n = r->n, s = r->implicit->c.method->s, band = r->implicit->c.band, rules = r->s->series.moving.count + r->s->series.terms;
  double taylor = rules * (r->order + 1) * (r->order + 2) / 2;
  double linear = 0.5 * (s + 1) * n * (8 * band * band + 32 * band + 8);
  return taylor / (30 * rules + linear + 4 * s * s * n);
}

/* Start implicit steps where a decay rate has limited enough Taylor steps. If the program of derivatives is missing, the
 * step waits for it. */
static void watch_decay(Run *r, const Expansion *e, double h) {
  Implicit *m = r->implicit;
  double last = 0, before = 0, limit;
  if (r->step_count % EVERY_STEP) return;
  limit = HELD_PART * longest_decay(r->o.rtol);
  for (int i = 0; i < r->s->dimension; i++) {
    const double *c = e->states + (int64_t)i * r->stride;
    last = larger(fabs(c[r->order]) / e->allowed[i], last);
    before = larger(fabs(c[r->order - 1]) / e->allowed[i], before);
  }
  int shrinks = h < STEADY * r->held_length; /* as before a branch point */
  r->held_length = h;
  if (shrinks || !(h * r->order * last > limit * before)) { r->held_steps = 0; return; }
  r->held_steps++;
  if (r->o.method != METHOD_AUTO || !can_collocate(r) || r->held_steps < (m ? m->wait : HELD_STEPS)) return;
  if (!r->s->implicit) { r->wants_program = 1; r->held_steps--; return; }
  r->held_steps = 0;
  if (!begin_implicit(r)) return;
  m = r->implicit;
  memcpy(m->unknowns, r->unknowns, sizeof(double) * r->width);
  if (!jacobian_at_stage(r, 0, r->x, m->c.jacobian)) return;
  m->c.rho = fastest(&m->c, m->c.jacobian, 8);
  if (h * m->c.rho > limit) { set_known(m, r->mode, 1); m->leg = -1; m->steps = 0; }
  else m->wait *= 2;
}

/* Return to Taylor steps where those are cheaper, or where no implicit step is possible. */
static void watch_cost(Run *r, double h) {
  Implicit *m = r->implicit;
  if (h > 0 && r->o.method == METHOD_AUTO) {
    m->c.rho = fastest(&m->c, m->c.jacobian, 1);
    m->idle = h * m->c.rho * cost_ratio(r) < longest_decay(r->o.rtol) ? m->idle + 1 : 0;
  }
  m->steps++;
  if (h > 0 && m->idle < IDLE_STEPS) return;
  set_known(m, r->mode, 0);
  m->wait = m->steps > 2 * IDLE_STEPS ? HELD_STEPS : 2 * m->wait;
  m->idle = 0;
}
