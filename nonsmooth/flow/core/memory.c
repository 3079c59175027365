/* Memory ------------------------------------------------------------------------------------------- */

/* Where ``count`` objects of a size begin; with no base, how far one has come. */
static void *place(char *base, size_t *used, size_t size, size_t count) {
  *used = (*used + 15) & ~(size_t)15;
  void *at = base ? base + *used : 0;
  *used += size * (count + 1);
  return at;
}
#define DOUBLES(count) place(base, &used, sizeof(double), (size_t)(count))
#define INTEGERS(count) place(base, &used, sizeof(int32_t), (size_t)(count))
#define LETTERS(count) place(base, &used, 1, (size_t)(count))

static size_t place_layout(Layout *l, char *base, size_t used, int width, int guards) {
  l->letter = LETTERS(width);
  l->sliding = INTEGERS(width);
  l->group = INTEGERS(width);
  l->kind = INTEGERS(guards);
  l->index = INTEGERS(guards);
  l->side = INTEGERS(guards);
  l->bent = INTEGERS(guards);
  return used;
}

static size_t place_expansion(Expansion *e, char *base, size_t used, int n, int width, int guards, int stride,
                              int sets) {
  used = place_layout(&e->l, base, used, width, guards);
  e->states = DOUBLES(n * stride);
  e->guards = DOUBLES(guards * stride);
  e->series = DOUBLES(width * stride);
  e->allowed = DOUBLES(n);
  e->of_guards = DOUBLES(guards);
  e->scale = DOUBLES(guards);
  e->steep = DOUBLES(guards);
  e->inverse = DOUBLES(width * width);
  if (sets) {
    e->lambda = DOUBLES(width * stride);
    e->apart = DOUBLES(width * stride);
    e->root = DOUBLES(sets * stride);
    e->rates = DOUBLES(sets * (stride + 1));
    e->slopes = DOUBLES(width * width);
    e->radius = DOUBLES(sets);
    e->per_radius = DOUBLES(sets);
  }
  return used;
}

static size_t place_continuation(Continuation *c, char *base, size_t used, int width, int guards) {
  c->letter = LETTERS(width);
  c->drop = INTEGERS(guards);
  c->unknowns = DOUBLES(width);
  return used;
}

static size_t place_instant(Instant *i, char *base, size_t used, const System *s) {
  int atoms = s->rules.atoms, triggers = s->rules.triggers, clocks = s->rules.clocks;
  int8_t **flags[] = {&i->side, &i->view, &i->now, &i->passing, &i->zero};
  for (int k = 0; k < 5; k++) *flags[k] = LETTERS(atoms);
  i->pending = LETTERS(triggers);
  i->was = LETTERS(triggers);
  i->value = DOUBLES(atoms);
  i->noise = DOUBLES(atoms);
  i->residual = DOUBLES(atoms);
  i->germ = DOUBLES(GERM * atoms);
  i->trigger_x = DOUBLES(s->rules.keeps ? (size_t)triggers * s->n : 0);
  i->arrived = DOUBLES(s->n);
  i->tick = DOUBLES(2 * clocks);
  i->count = place(base, &used, sizeof(int64_t), (size_t)clocks);
  return used;
}

/* Lemke's method on a block of all takes most of it. */
static size_t place_decision(Run *r, char *base, size_t used) {
  size_t w = r->width, square = w * w, orders = (ORDERS + 1) * w;
  Decision *d = r->decision = place(base, &used, sizeof(Decision), 1);
  if (!base) d = r->decision = 0;
  Decision none = {0}, *to = d ? d : &none;
  to->own = INTEGERS(w); to->order = INTEGERS(w); to->first = INTEGERS(w + 1); to->mark = INTEGERS(4 * w);
  to->pivot = INTEGERS(8 * w + 8); to->proved = INTEGERS(w);
  to->is_contact = LETTERS(w); to->is_idle = LETTERS(w); to->is_touched = LETTERS(w); to->is_known = LETTERS(w);
  to->state = LETTERS(orders + w); to->block_state = LETTERS(3 * w); to->large_class = LETTERS(w);
  to->matrix = DOUBLES(square); to->share = DOUBLES(square);
  to->a = DOUBLES(orders); to->b = DOUBLES(orders); to->nu = DOUBLES(orders); to->floor = DOUBLES(orders);
  to->turn = DOUBLES(w); to->sign = DOUBLES(w); to->old = DOUBLES(w); to->yard = DOUBLES(w); to->room = DOUBLES(w);
  to->steep = DOUBLES(w); to->block = DOUBLES(6 * square + 8 * w); to->large = DOUBLES(w);
  to->work = DOUBLES(90 * square + 90 * w + 64);
  for (int i = 0; i < SEVERAL; i++) {
    Motion *own = to->motion + i;
    own->state = LETTERS(w); own->order = LETTERS(w); own->before = LETTERS(w);
    own->nu = DOUBLES(w); own->series = DOUBLES(COMPARED * (size_t)r->n);
  }
  return used;
}

static size_t place_run(Run *r, char *base) {
  const System *s = r->s;
  int n = r->n, w = r->width, c = r->c, all = r->kept_rows, g = r->guards, stride = r->stride;
  size_t used = 0, square = (size_t)w * w, rows = (size_t)(g + w) * stride;
  used = place_layout(&r->now, base, used, w, g);
  used = place_expansion(&r->e, base, used, n, w, g, stride, s->sets);
  used = place_expansion(&r->trial, base, used, n, w, g, stride, s->sets);
  Continuation *each[] = {&r->chosen, &r->one, &r->first, &r->rest, &r->found};
  for (int i = 0; i < 5; i++) used = place_continuation(each[i], base, used, w, g);
  used = place_decision(r, base, used);
  r->letter = LETTERS(w);
  r->start = LETTERS(w);
  r->x = DOUBLES(n);
  r->at_x = DOUBLES(n);
  r->before = DOUBLES(n);
  r->saved = DOUBLES(n);
  r->speed = DOUBLES(w);
  r->at_root = DOUBLES(3 * n);
  r->at_work = DOUBLES(n);
  r->unknowns = DOUBLES(w);
  r->tried = DOUBLES(w);
  r->solutions = DOUBLES(SOLUTIONS * w);
  r->tried_letter = LETTERS(2 * w);
  r->drop = INTEGERS(g);
  r->active = INTEGERS(w);
  r->involved = INTEGERS(3 * w + 2 * all + 1);
  r->p = DOUBLES(s->parameters);
  r->series = DOUBLES((size_t)s->series.size * stride);
  r->point = DOUBLES(s->point.size);
  r->heights = DOUBLES(s->surfaces.size);
  r->maps = DOUBLES(s->maps.size);
  r->restitution = DOUBLES(s->restitution.size);
  r->columns = DOUBLES(s->columns.size);
  r->input = DOUBLES(n + 2 * w);
  r->held = DOUBLES(w);
  r->none = DOUBLES(w);
  r->slope = DOUBLES(square);
  r->vector = DOUBLES(3 * n + 2 * w);
  r->sample = DOUBLES(3 * ((size_t)n + w + g));
  r->work = DOUBLES(6 * square + 8 * w + rows + g);
  r->gradient_row = DOUBLES((size_t)all * n + 2 * all);
  r->rates = DOUBLES(2 * all + c);
  r->lam = DOUBLES(2 * w);
  r->matrix = DOUBLES(square + 6 * w + all + 2 * c);
  r->small = DOUBLES(4 * w + s->rules.atoms);
  r->atom_work = DOUBLES(s->atoms.size);
  r->choice_work = DOUBLES(s->choices.size);
  used = place_instant(&r->instant, base, used, s);
  r->pending = INTEGERS(6 * w + 2 * all);
  r->sparse = INTEGERS(square + 2 * w + 1);
  r->direction = DOUBLES(w);
  r->later = DOUBLES(w);
  r->heights_of = DOUBLES(w);
  r->aside = DOUBLES(2 * n);
  r->moving = LETTERS(w);
  r->turned = LETTERS(g);
  r->rates_of_several = DOUBLES(SEVERAL * n);
  size_t q = r->m < MOST_ENUMERATED ? r->m : MOST_ENUMERATED, sums = q * (q - (q > 0)) / 2;
  r->layer_series = DOUBLES(s->slope_outputs ? (q * q + sums * sums) * stride : 0);
  r->idle = LETTERS(s->sets);
  r->vanishes = LETTERS(s->point.size > s->columns.size ? s->point.size : s->columns.size);
  r->of_defect = DOUBLES(g);
  r->laws = DOUBLES(s->sets ? square + 2 * w : 0);
  r->key = LETTERS(w + 8 * s->rules.discrete);
  r->met_at = DOUBLES(g);
  return used;
}
