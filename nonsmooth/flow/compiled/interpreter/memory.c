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

static size_t place_run(Run *r, char *base) {
  const System *s = r->s;
  int n = r->n, w = r->width, c = r->c, all = r->m + 2 * c, g = r->guards, stride = r->stride;
  size_t used = 0, square = (size_t)w * w, rows = (size_t)(g + w) * stride;
  used = place_layout(&r->now, base, used, w, g);
  used = place_expansion(&r->e, base, used, n, w, g, stride, s->sets);
  used = place_expansion(&r->trial, base, used, n, w, g, stride, s->sets);
  Continuation *each[] = {&r->chosen, &r->one, &r->first, &r->rest, &r->found};
  for (int i = 0; i < 5; i++) used = place_continuation(each[i], base, used, w, g);
  r->letter = LETTERS(w);
  r->start = LETTERS(w);
  r->x = DOUBLES(n);
  r->at_x = DOUBLES(n);
  r->before = DOUBLES(n);
  r->saved = DOUBLES(n);
  r->at_work = DOUBLES(n);
  r->unknowns = DOUBLES(w);
  r->tried = DOUBLES(w);
  r->solutions = DOUBLES(SOLUTIONS * w);
  r->tried_letter = LETTERS(2 * w);
  r->drop = INTEGERS(g);
  r->side = INTEGERS(s->stops + s->resets);
  r->fired = INTEGERS(s->resets);
  r->active = INTEGERS(w);
  r->involved = INTEGERS(3 * w + 1);
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
  r->work = DOUBLES(2 * square + 4 * w + rows + g);
  r->gradient_row = DOUBLES((size_t)all * n + 2 * all);
  r->rates = DOUBLES(2 * all + c);
  r->lam = DOUBLES(2 * w);
  r->matrix = DOUBLES(square + 6 * w + all + 2 * c);
  r->small = DOUBLES(4 * w + s->stops + s->resets);
  r->pending = INTEGERS(6 * w + 2 * all);
  r->sparse = INTEGERS(square + 2 * w + 1);
  r->direction = DOUBLES(w);
  r->later = DOUBLES(w);
  r->heights_of = DOUBLES(w);
  r->aside = DOUBLES(2 * n);
  r->moving = LETTERS(w);
  r->idle = LETTERS(s->sets);
  r->vanishes = LETTERS(s->point.size > s->columns.size ? s->point.size : s->columns.size);
  r->of_defect = DOUBLES(g);
  r->laws = DOUBLES(s->sets ? square + 2 * w : 0);
  return used;
}
