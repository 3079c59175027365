/* Modes: nonsmooth/model/coupled.py, nonsmooth/flow/reference/modes.py --------------------------------- */

/* Whether a multiplier makes no difference: on its surface, or at an open contact. */
static int is_idle(const Run *r, const int8_t *letter, int i) {
  const System *s = r->s;
  if (i >= s->m) return 0;
  if (s->continuous[i]) return 1;
  for (int j = 0; j < s->c; j++) if (s->carries[i * s->c + j] && letter[s->m + j]) return 1;
  return 0;
}

static int add_row(Layout *l, int kind, int index, int side) {
  int k = l->rows++;
  l->kind[k] = kind; l->index[k] = index; l->side[k] = side;
  return k;
}

static int is_pair(const Run *r, const Layout *l) { return l->slides == 2 && l->sliding[1] < r->m; }

static void lay_out(const Run *r, const int8_t *letter, Layout *l) {
  const System *s = r->s;
  memmove(l->letter, letter, r->width);
  l->rows = l->slides = l->branches = 0;
  l->mode = mode_number(r->table, letter);
  for (int i = 0; i < r->width; i++) {
    if (letter[i] == 0 && !is_idle(r, letter, i)) l->sliding[l->slides++] = i;
    if (i >= s->m) add_row(l, letter[i] ? IMPACT_GUARD : RELEASE_GUARD, i - s->m, letter[i]);
    else if (letter[i]) add_row(l, SURFACE_GUARD, i, letter[i]);
    else { add_row(l, EXIT_GUARD, i, 1); add_row(l, EXIT_GUARD, i, -1); }
  }
  for (int j = 0; j < s->stops; j++) add_row(l, STOP_GUARD, j, s->stop_direction[j]);
  for (int j = 0; j < s->resets; j++) add_row(l, RESET_GUARD, j, s->reset_direction[j]);
  int first = 0, w = r->width, moves = 0;
  for (int i = l->slides - 1; i >= 0; i--) if (l->sliding[i] < s->m) first = l->sliding[i];
  if (is_pair(r, l)) {
    int one = l->sliding[0], two = l->sliding[1];
    moves |= s->slope_moves[one * w + one] | s->slope_moves[one * w + two];
    moves |= s->slope_moves[two * w + one] | s->slope_moves[two * w + two];
    l->branches = moves ? 2 : 0;
  } else {
    for (int i = 0; i < l->slides; i++) l->branches += s->slope_moves[l->sliding[i] * (w + 1)];
  }
  for (int k = 0; k < l->branches; k++) add_row(l, BRANCH_GUARD, first, 0);
}

/* Letters as the multipliers that are known: +1 and -1, 0 for what slides, open and closed contacts. */
static const double *held_of(Run *r, const int8_t *letter) {
  for (int i = 0; i < r->width; i++) r->held[i] = i < r->m ? letter[i] : 0;
  return r->held;
}

/* The moving inputs: states, lambda and reactions, then nu. */
static void set_inputs(Run *r, const double *x, const double *held, const double *unknowns) {
  double *in = r->input;
  memcpy(in, x, sizeof(double) * r->n);
  in += r->n;
  for (int i = 0; i < r->width; i++)
    in[i] = held[i] + (i < r->m && r->s->scaled[i] ? 0 : unknowns[i]);
  in += r->width;
  for (int i = 0; i < r->m; i++) if (r->s->scaled[i]) *in++ = unknowns[i];
}

static double out_of(const Values *t, const double *w, int k) { return w[t->output[k]]; }

/* Layer, factors, slope and gradients at a point; r->slope is dense. */
static void yardsticks(Run *r, const double *x, const double *held, const double *unknowns) {
  const Entries *slope = &r->s->slope;
  set_inputs(r, x, held, unknowns);
  values_run(&r->s->point, r->input, r->p, r->point);
  for (int k = 0; k < slope->count; k++)
    r->slope[slope->row[k] * r->width + slope->column[k]] = out_of(&r->s->point, r->point, 2 * r->width + k);
}
static double layer_of(const Run *r, int i) { return out_of(&r->s->point, r->point, i); }
static double factor_of(const Run *r, int i) { return out_of(&r->s->point, r->point, r->width + i); }

/* Sums over the states of |gradient| times a vector, for each row; infinite slopes, those of a square root
 * at zero, say nothing about rounding and are left out where asked for. */
static void gradient_sums(const Run *r, const Values *t, const double *w, int first, const Entries *g, int rows,
                          const double *vector, int finite_only, double *sum) {
  for (int i = 0; i < rows; i++) sum[i] = 0;
  for (int k = 0; k < g->count; k++) {
    double slope = fabs(out_of(t, w, first + k));
    if (!finite_only || slope < INFINITY) sum[g->row[k]] += slope * vector[g->column[k]];
  }
}

/* Yardsticks of the guards from those of surfaces, of sliding multipliers and of stops. */
static void guard_sums(Run *r, const Expansion *e, const double *vector, int finite_only, double *result) {
  const System *s = r->s;
  const Layout *l = &e->l;
  int w = r->width, first = 2 * w + s->slope.count, row = 0, slides = l->slides;
  double *layer = r->small, *height = layer + w, *stop = height + w, *through = stop + s->stops + s->resets, *factor = through + w;
  gradient_sums(r, &s->point, r->point, first, &s->layer_gradient, w, vector, finite_only, layer);
  first += s->layer_gradient.count;
  gradient_sums(r, &s->point, r->point, first, &s->height_gradient, w, vector, finite_only, height);
  first += s->height_gradient.count;
  gradient_sums(r, &s->point, r->point, first, &s->stop_gradient, s->stops + s->resets, vector, finite_only, stop);
  first += s->stop_gradient.count;
  gradient_sums(r, &s->point, r->point, first, &s->factor_gradient, w, vector, finite_only, factor);
  for (int i = 0; i < slides; i++) {
    through[i] = 0;
    for (int j = 0; j < slides; j++) {
      double a = fabs(e->inverse[i * slides + j]);
      if (a != 0) through[i] += a * layer[l->sliding[j]];
    }
  }
  for (int i = 0; i < slides; i++) layer[l->sliding[i]] = through[i];
  for (int i = 0; i < s->m; i++) layer[i] += factor[i];
  double worst = 0;
  for (int i = 0; i < w; i++) worst = larger(layer[i], worst);
  for (; row < l->rows; row++) {
    int kind = l->kind[row], index = l->index[row];
    if (kind == SURFACE_GUARD) result[row] = height[index];
    else if (kind == IMPACT_GUARD) result[row] = height[s->m + index];
    else if (kind == EXIT_GUARD) result[row] = layer[index];
    else if (kind == RELEASE_GUARD) result[row] = layer[s->m + index];
    else if (kind == STOP_GUARD) result[row] = stop[index];
    else if (kind == RESET_GUARD) result[row] = stop[s->stops + index];
    else result[row] = worst;
  }
}

static const double *row_of(const Run *r, int output) {
  return r->series + (int64_t)r->s->series.output[output] * r->stride;
}

static const double *slope_row(const Run *r, int i, int j) {
  static const double zero[P + 1];
  int output = r->s->slope_output[i * r->width + j];
  return output < 0 ? zero : row_of(r, r->n + 3 * r->width + r->s->stops + r->s->resets + output);
}

/* The slope of one multiplier, determinant and trace of that of two, or its diagonal, turned to begin
 * positive. */
static void branch_rows(const Run *r, const Layout *l, int count, double *g) {
  int stride = r->stride, row = 0;
  if (is_pair(r, l)) {
    int i = l->sliding[0], j = l->sliding[1];
    const double *a = slope_row(r, i, i), *b = slope_row(r, i, j), *c = slope_row(r, j, i), *d = slope_row(r, j, j);
    for (int k = 0; k < count; k++) {
      g[k] = convolve(a, d, k, 0, k) - convolve(b, c, k, 0, k);
      g[stride + k] = a[k] + d[k];
    }
    row = 2;
  } else {
    for (int i = 0; i < l->slides; i++)
      if (r->s->slope_moves[l->sliding[i] * (r->width + 1)])
        memcpy(g + (int64_t)row++ * stride, slope_row(r, l->sliding[i], l->sliding[i]), sizeof(double) * count);
  }
  for (int j = 0; j < row; j++) {
    double *own = g + (int64_t)j * stride, turn = 1;
    for (int k = 0; k < count; k++) if (own[k] != 0) { turn = ns_sign(own[k]); break; }
    for (int k = 0; k < count; k++) own[k] *= turn;
  }
}

/* Guards from the series (or, with count 1, values) of what they are made of. */
static void guard_rows(Run *r, const Layout *l, const double *series, int count, double *guards) {
  const System *s = r->s;
  int w = r->width, n = r->n, stride = r->stride;
  for (int row = 0; row < l->rows; row++) {
    int kind = l->kind[row], i = l->index[row], side = l->side[row];
    double *g = guards + (int64_t)row * stride;
    if (kind == SURFACE_GUARD || kind == IMPACT_GUARD) {
      const double *h = row_of(r, n + w + i + (kind == IMPACT_GUARD ? s->m : 0));
      for (int k = 0; k < count; k++) g[k] = side * h[k];
    } else if (kind == RELEASE_GUARD) {
      memcpy(g, series + (int64_t)(s->m + i) * stride, sizeof(double) * count);
    } else if (kind == EXIT_GUARD && is_idle(r, l->letter, i)) {
      const double *layer = row_of(r, n + i);
      for (int k = 0; k < count; k++) g[k] = -side * layer[k];
    } else if (kind == EXIT_GUARD) {
      const double *factor = row_of(r, n + 2 * w + i), *lam = series + (int64_t)i * stride;
      double turn = 1;
      for (int k = 0; k < count; k++) if (factor[k] != 0) { turn = ns_sign(factor[k]); break; }
      for (int k = 0; k < count; k++) g[k] = turn * (factor[k] - side * lam[k]);
    } else if (kind == BRANCH_GUARD) {
      branch_rows(r, l, count, g);
      break;
    } else {
      const double *stop = row_of(r, n + 3 * w + i + (kind == RESET_GUARD ? s->stops : 0));
      memcpy(g, stop, sizeof(double) * count);
    }
  }
}

/* Coefficients k of the multipliers that slide keep those of the layer's rates at zero. */
static void follow_layer(Run *r, Expansion *e, int k, const int32_t *start) {
  int slides = e->l.slides;
  for (int i = 0; i < slides; i++) {
    double sum = 0;
    for (int q = start[i]; q < start[i + 1]; q++) {
      int j = start[slides + 1 + q];
      sum += e->inverse[i * slides + j] * row_of(r, r->n + e->l.sliding[j])[k];
    }
    e->series[(int64_t)e->l.sliding[i] * r->stride + k] = -sum;
  }
}

/* Coefficient k of states and multipliers as the inputs of the series. */
static void inputs_of(Run *r, const Expansion *e, int k) {
  double *x = r->vector, *lam = x + r->n;
  for (int i = 0; i < r->n; i++) x[i] = e->states[(int64_t)i * r->stride + k];
  for (int i = 0; i < r->width; i++) lam[i] = e->series[(int64_t)i * r->stride + k];
  set_inputs(r, x, k ? r->none : r->held, lam);
}

/* Coefficients k of all that a mode needs. */
static void advance_series(Run *r, const Layout *l, int k) {
  const Series *t = &r->s->series;
  int slides = 0;
  for (int i = 0; i < r->width; i++) slides |= l->letter[i] == 0;
  if (slides) series_rules(t, t->moving, t->moving_count, k, r->stride, r->input, r->series);
  else series_rules(t, t->free, t->free_count, k, r->stride, r->input, r->series);
}

static void jets(Run *r, Expansion *e) {
  const Series *t = &r->s->series;
  int slides = e->l.slides, order = r->order, stride = r->stride;
  int32_t *start = r->sparse, *column = start + slides + 1, count = 0;
  for (int i = 0; i < slides; i++) {
    start[i] = count;
    for (int j = 0; j < slides; j++) if (e->inverse[i * slides + j] != 0) column[count++] = j;
  }
  start[slides] = count;
  for (int k = 0; k <= order; k++) {
    inputs_of(r, e, k);
    advance_series(r, &e->l, k);
    if (k && slides) {
      follow_layer(r, e, k, start);
      inputs_of(r, e, k);
      series_rules(t, t->late, t->late_count, k, stride, r->input, r->series);
    }
    if (k < order)
      for (int i = 0; i < r->n; i++) e->states[(int64_t)i * stride + k + 1] = row_of(r, i)[k] / (k + 1);
  }
  guard_rows(r, &e->l, e->series, order + 1, e->guards);
}

/* Jets of a mode at x, with the multipliers of what slides; inverses of the layer's slope. */
static void expand(Run *r, const int8_t *letter, const double *x, const double *unknowns, Expansion *e) {
  int w = r->width, order = r->order, stride = r->stride;
  lay_out(r, letter, &e->l);
  yardsticks(r, x, held_of(r, letter), unknowns);
  int slides = e->l.slides;
  for (int i = 0; i < slides; i++)
    for (int j = 0; j < slides; j++)
      r->work[i * slides + j] = r->slope[e->l.sliding[i] * w + e->l.sliding[j]];
  invert(r->work, slides, e->inverse);
  double zero = 0;
  memset(e->series, 0, sizeof(double) * w * stride);
  for (int i = 0; i < r->n; i++) e->states[(int64_t)i * stride] = x[i];
  for (int i = 0; i < slides; i++) e->series[(int64_t)e->l.sliding[i] * stride] = unknowns[e->l.sliding[i]];
  double *one = r->vector, *near = one + r->n;
  for (int i = 0; i < r->n; i++) {
    int moves = i < r->s->dimension;
    e->allowed[i] = moves ? SAFETY * (r->o.atol + r->o.rtol * fabs(x[i])) : 0;
    one[i] = 1;
    near[i] = r->size + fabs(x[i]);
  }
  guard_sums(r, e, e->allowed, 0, e->of_guards);
  guard_sums(r, e, one, 0, e->steep);
  guard_sums(r, e, near, 1, e->scale);
  jets(r, e);
  for (int i = 0; i < r->n; i++) for (int k = 0; k <= order; k++) zero += 0 * e->states[(int64_t)i * stride + k];
  for (int j = 0; j < e->l.rows; j++) for (int k = 0; k <= order; k++) zero += 0 * e->guards[(int64_t)j * stride + k];
  e->finite = zero == 0;
}

/* Multipliers that keep the sliding surfaces of a mode: one step of Newton's method, since they enter
 * linearly, and one against rounding. 0 where there are none. */
static int improve(Run *r, const Layout *l, const double *x, double *unknowns, int steps) {
  int w = r->width, slides = l->slides;
  for (int iteration = 0; slides && iteration < steps; iteration++) {
    double largest = 0, most = 0;
    yardsticks(r, x, held_of(r, l->letter), unknowns);
    double *a = r->work, *b = a + slides * slides;
    for (int i = 0; i < slides; i++) {
      for (int j = 0; j < slides; j++) a[i * slides + j] = r->slope[l->sliding[i] * w + l->sliding[j]];
      b[i] = layer_of(r, l->sliding[i]);
    }
    if (!solve(a, b, slides)) return 0;
    for (int i = 0; i < slides; i++) {
      unknowns[l->sliding[i]] -= b[i];
      largest = larger(fabs(b[i]), largest);
    }
    for (int i = 0; i < w; i++) most = larger(fabs(unknowns[i]), most);
    if (largest <= 1e-16 * (1 + most)) break;
  }
  return 1;
}
