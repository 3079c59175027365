/* When steps are implicit: where a decay rate holds Taylor steps, and an implicit step costs less. */

/* The part of the longest Taylor step that a decay rate allows, in units of its inverse. */
static double longest_decay(const Run *r) { return 3 - 0.5 * log10(r->o.rtol); }

static int can_collocate(const Run *r) {
  return r->o.method != METHOD_TAYLOR && !r->s->sets && !r->has_roots && !r->repelling && r->n <= MOST_STATES;
}

static void set_known(Collocation *m, int mode, int8_t known) {
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

/* After a step: the next one begins at its end, with the derivative there. */
static void go_on_implicitly(Run *r) {
  Collocation *m = r->collocation;
  double *kept = m->jacobian;
  r->implicit_count++;
  m->from = 1;
  m->is_fresh = m->is_end_known;
  m->jacobian = m->end_jacobian;
  m->end_jacobian = kept;
}

/* Whether the next step is implicit: never the first of a leg, in which guards have known zeros. */
static int is_implicit(Run *r) {
  Collocation *m = r->collocation;
  if (r->since <= 0 || !can_collocate(r)) return 0;
  if (r->o.method == METHOD_STIFF && !r->s->implicit) { r->wants_program = 1; return 0; }
  if (r->o.method == METHOD_STIFF && !m && begin_collocation(r)) m = r->collocation;
  if (!m || !(r->o.method == METHOD_STIFF || (r->mode < m->modes && m->known[r->mode]))) return 0;
  if (m->leg != r->event_count) {
    m->leg = r->event_count;
    m->h = EIGHTFOLD * r->length;
    m->length = 0;
    m->is_fresh = 0;
    m->error = 1;
    m->idle = 0;
  }
  return 1;
}

/* The fastest rate, renewed by products with the field's derivative. */
static double fastest(Run *r, const double *jacobian, int pairs) {
  Collocation *m = r->collocation;
  int n = r->n;
  double *v = m->fast, *next = m->work, rho = 0;
  for (int pass = 0; pass < pairs; pass++) {
    double size = 0, grown = 0;
    for (int i = 0; i < n; i++) size = larger(fabs(v[i]), size);
    if (!(size > 0 && size < INFINITY)) for (int i = 0; i < n; i++) v[i] = 1 + 0.1 * i / n;
    else for (int i = 0; i < n; i++) v[i] /= size;
    for (int product = 0; product < 2; product++) {
      for (int i = 0; i < n; i++) {
        next[i] = 0;
        for (int j = 0; j < n; j++) next[i] += jacobian[(int64_t)i * n + j] * v[j];
      }
      memcpy(v, next, sizeof(double) * n);
    }
    for (int i = 0; i < n; i++) grown = larger(fabs(v[i]), grown);
    rho = sqrt(grown);
  }
  return rho;
}

/* Operations of a Taylor step over those of an implicit one. */
static double cost_ratio(const Run *r) {
  double n = r->n, s = r->collocation->method->s, band = r->collocation->band, rules = r->s->series.moving.count + r->s->series.terms;
  double taylor = rules * (r->order + 1) * (r->order + 2) / 2;
  double linear = 0.5 * (s + 1) * n * (8 * band * band + 32 * band + 8);
  return taylor / (30 * rules + linear + 4 * s * s * n);
}

/* Whether a decay rate holds a Taylor step, as so many before. Where that takes the program of derivatives the step is
 * made once it is there. */
static void watch_decay(Run *r, const Expansion *e, double h) {
  Collocation *m = r->collocation;
  double last = 0, before = 0, limit;
  if (r->step_count % EVERY_STEP) return;
  limit = HELD_PART * longest_decay(r);
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
  if (!begin_collocation(r)) return;
  m = r->collocation;
  if (!jacobian_at(r, &e->l, r->x, r->unknowns, m->jacobian)) return;
  m->rho = fastest(r, m->jacobian, 8);
  if (h * m->rho > limit) { set_known(m, r->mode, 1); m->leg = -1; m->steps = 0; }
  else m->wait *= 2;
}

/* Go back to Taylor steps where those would be cheaper, or where no implicit step is possible. */
static void watch_cost(Run *r, double h) {
  Collocation *m = r->collocation;
  if (h > 0 && r->o.method == METHOD_AUTO) {
    m->rho = fastest(r, m->jacobian, 1);
    m->idle = h * m->rho * cost_ratio(r) < longest_decay(r) ? m->idle + 1 : 0;
  }
  m->steps++;
  if (h > 0 && m->idle < IDLE_STEPS) return;
  set_known(m, r->mode, 0);
  m->wait = m->steps > 2 * IDLE_STEPS ? HELD_STEPS : 2 * m->wait;
  m->idle = 0;
}
