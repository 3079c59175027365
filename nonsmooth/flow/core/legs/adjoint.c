/* Rows of derivatives, pulled back through the transposed recursion of columns (variation.c).
 *
 * A row has the derivatives of a quantity by all coefficients of the recursion. From the last order to the first, each
 * coefficient adds its derivative to those of its arguments; the derivatives by the first coefficients are the row before
 * the step. Derivatives by all parameters are included, at the cost of one column.
 */

/* Pull links of a group back at an order. */
static void pull_links(const Slopes *g, int group, int k) {
  int count = g->begin[group + 1] - g->begin[group];
  for (int q = 0; q < count; q++) {
    const Link *l = g->link + g->begin[group] + (group == DIRECTIONS ? count - 1 - q : q);
    double own = l->to[k];
    int at = k + l->ahead, last = at < l->terms ? at : l->terms - 1;
    if (own == 0) continue;
    if (l->factor == MINUS) own = -own;
    if (l->factor == TIMES_ORDER) own *= k + 1;
    if (l->factor == OVER_ORDER) own *= PART[k + 1];
    if (l->terms == 1 && l->first == 0) { l->from[at] += l->value * own; continue; }
    for (int j = l->first; j <= last; j++) l->from[at - j] += l->by[j] * own;
  }
}

/* Pull sums up to an order back to parameters. */
static void pull_parameters(const Run *r, const Slopes *g, int order) {
  int size = moving_size(r);
  for (int j = 0; j < r->s->parameters; j++)
    for (int q = g->first[size + j]; q < g->first[size + j + 1]; q++) {
      int row = r->s->derivatives.row[q], last = g->terms[q] - 1 < order ? g->terms[q] - 1 : order;
      const double *slope = derivative_row(r, q), *sum = g->v->sum + (int64_t)row * r->stride;
      for (int k = 0; k <= last; k++) g->v->p[j] += slope[k] * sum[k];
    }
}

/* Pull coefficients and sums up to an order back to the first coefficients of states and of h, and to parameters. */
static void pull_series(Run *r, const Expansion *e, const Slopes *g, int order) {
  for (int k = order; k >= 0; k--)
    for (int group = k < r->order ? NEXT : LATE; group >= DIRECTIONS; group--) {
      if (group == UNKNOWNS && g->leaving) solve_leaving(r, e, g->v, k, 1);
      pull_links(g, group, k);
    }
  pull_links(g, AT_START, 0);
  pull_parameters(r, g, order);
}

/* Pull values of surfaces at a point back to states and parameters. */
static void pull_surfaces(const Run *r, const Slopes *g, const double *h) {
  memset(g->v->sum, 0, sizeof(double) * (r->n + 3 * r->width) * r->stride);
  for (int i = 0; i < r->m; i++) g->v->sum[(int64_t)(r->n + r->width + i) * r->stride] = h[i];
  pull_links(g, SUMS, 0);
  pull_parameters(r, g, 0);
}

/* The gradient of a leg's event function by states and parameters. */
static void event_gradient(Run *r, const Leg *l, Slopes *g) {
  const Expansion *e = &r->e;
  const Variation *c = g->v;
  int n = r->n, w = r->width, stride = r->stride, own = l->index;
  double *unknown = c->series + (int64_t)own * stride, *sum = c->sum, *factor = sum + (int64_t)(n + 2 * w + own) * stride;
  clear_variation(c);
  measure_slopes(r, e, g, 1);
  memset(c->p, 0, sizeof(double) * r->s->parameters);
  if (l->hit >= 0)
    for (int i = l->hit; i < l->hit + size_of(r, l->hit); i++)
      sum[(int64_t)(n + w + i) * stride] = e->lambda[(int64_t)i * stride];
  else if (l->kind == SURFACE_GUARD) sum[(int64_t)(n + w + own) * stride] = 1;
  else if (l->kind == RELEASE_GUARD) *unknown = 1;
  else if (l->kind == EXIT_GUARD && is_idle(r, e->l.letter, own)) sum[(int64_t)(n + own) * stride] = -l->side;
  else if (l->kind == EXIT_GUARD) {
    *factor = turn_of(r, own, row_of(r, n + 2 * w + own), r->order + 1);
    *unknown = -l->side * *factor;
  } else {
    for (int i = 0; i < size_of(r, own); i++)
      unknown[(int64_t)i * stride] = -2 * e->series[(int64_t)(own + i) * stride];
    *factor = 2 * row_of(r, n + 2 * w + own)[0];
  }
  pull_series(r, e, g, 0);
  if (r->s->sets) { /* integrated h */
    for (int i = 0; i < r->m; i++) c->h[i] = e->l.letter[i] == LEFT_BEHIND ? c->series[(int64_t)i * stride] : 0;
    pull_surfaces(r, g, c->h);
  }
  for (int i = 0; i < n; i++) l->gradient[i] = c->states[(int64_t)i * stride];
  memcpy(l->gradient + n, c->p, sizeof(double) * r->s->parameters);
}

/* Pull y and h after the start of a leg back to before it: the transpose of ``land``. */
static void pull_land(Run *r, Leg *l, Slopes *g) {
  const Expansion *e = &r->e;
  const Variation *c = g->v;
  int slides = e->l.slides;
  if (!r->s->sets) return;
  clear_variation(c);
  measure_slopes(r, e, g, 1);
  for (int i = 0; i < r->n; i++) c->sum[(int64_t)i * r->stride] = l->row[i];
  pull_links(g, LATE, 0);
  for (int i = 0; i < r->m; i++) if (set_of(r, i) < 0 || e->l.letter[i] == 0) c->h[i] = 0;
  for (int i = 0; i < slides; i++)
    for (int q = e->from[i]; q < e->to[i]; q++) {
      int j = e->l.sliding[e->column[q]];
      if (set_of(r, j) >= 0) c->h[j] -= e->inverse[q] * c->series[(int64_t)e->l.sliding[i] * r->stride];
    }
  clear_variation(c);
  pull_surfaces(r, g, c->h);
  for (int i = 0; i < r->n; i++) l->row[i] += c->states[(int64_t)i * r->stride];
}

/* Whether a sample time is in the step that begins ``begun`` after the start of a leg. */
static int is_within(const Leg *l, double begun, double t) {
  return begun <= 0 || way_of_leg(l) * t > begun + 4 * EPSILON * length_of_leg(l);
}

/* Pull a row back from the end of a Taylor step with known expansion to its start. */
static void pull_step(Run *r, Leg *l, Slopes *g, double dt, double begun, int64_t *sample) {
  const Variation *c = g->v;
  int n = r->n, order = r->order, stride = r->stride;
  double power = 1;
  clear_variation(c);
  for (int k = 0; k <= order; k++, power *= dt) {
    for (int i = 0; i < n; i++) c->states[(int64_t)i * stride + k] = power * l->row[i];
    for (int i = 0; i < r->m && r->s->sets; i++)
      if (set_of(r, i) >= 0 && r->letter[i]) c->series[(int64_t)i * stride + k] = power * c->h[i];
  }
  for (; *sample > 0 && is_within(l, begun, l->sample_t[*sample - 1]); --*sample) {
    const double *own = l->at_samples + (*sample - 1) * n;
    power = 1;
    for (int k = 0; k <= order; k++, power *= l->sample_t[*sample - 1] - way_of_leg(l) * begun)
      for (int i = 0; i < n; i++) c->states[(int64_t)i * stride + k] += power * own[i];
  }
  measure_slopes(r, &r->e, g, 0);
  pull_series(r, &r->e, g, order - 1);
  for (int i = 0; i < n; i++) l->row[i] = c->states[(int64_t)i * stride];
  for (int i = 0; i < r->m; i++) c->h[i] = c->series[(int64_t)i * stride];
}

/* Numbers of a row of the record. */
static int64_t row_width(const Run *r) { return 3 + r->n + r->width; }

static void record(const Run *r, Leg *l, double dt, double begun, int stages, const double *x, const double *unknowns) {
  double *row = l->steps + l->step_count++ * row_width(r);
  if (!l->steps || l->step_count > l->step_room) return;
  row[0] = dt; row[1] = begun; row[2] = stages;
  memcpy(row + 3, x, sizeof(double) * r->n);
  memcpy(row + 3 + r->n, unknowns, sizeof(double) * r->width);
}
