/* Surfaces: nonsmooth/model/laws/evaluators.py ---------------------------------------------------------- */

/* Surfaces, gaps and their rates at x; gradients stay among the program's values. */
static const double *surface_values(Run *r, const double *x) {
  const Values *t = &r->s->surfaces;
  run_surfaces(t, x, r->p, r->heights);
  for (int i = 0; i < m_of(r) + 2 * c_of(r); i++) r->rates[i] = out_of(t, r->heights, i);
  return r->rates;
}

/* Rounding in each of them, times epsilon, after surface_values. */
static const double *surface_scales(Run *r, const double *x) {
  double *near = r->vector, *scale = r->rates + m_of(r) + 2 * c_of(r);
  for (int i = 0; i < n_of(r); i++) near[i] = r->size + fabs(x[i]);
  gradient_sums(r, &r->s->surfaces, r->heights, m_of(r) + 2 * c_of(r), &r->s->surface_gradient, m_of(r) + 2 * c_of(r), near, 1,
                scale);
  return scale;
}

/* Least-norm Newton steps of the states (not the time) onto functions that are kept at zero: the rows are
 * made orthogonal one after the other, those that can overlap (a dependent row drops out). */
static void project_to(Run *r, const int32_t *which, int count, const double *level) {
  const Entries *g = &r->s->surface_gradient;
  int all = m_of(r) + 2 * c_of(r), nd = dimension_of(r);
  double *rows = r->gradient_row, *size = rows + (int64_t)all * n_of(r), *residual = size + all;
  for (int iteration = 0; count && iteration < 3; iteration++) {
    int any = 0, k = 0;
    const double *h = surface_values(r, r->x);
    int32_t *place = r->pending, *kept = place + all;
    for (int i = 0; i < all; i++) place[i] = -1;
    for (int i = 0; i < count; i++) { place[which[i]] = i; any |= h[which[i]] != (level ? level[i] : 0); }
    if (!any) break;
    memset(rows, 0, sizeof(double) * count * n_of(r));
    for (int q = 0; q < g->count; q++)
      if (place[g->row[q]] >= 0 && g->column[q] < nd)
        rows[(int64_t)place[g->row[q]] * n_of(r) + g->column[q]] = out_of(&r->s->surfaces, r->heights, all + q);
    for (int i = 0; i < count; i++) {
      double *row = rows + (int64_t)i * n_of(r), full = 0;
      for (int l = 0; l < nd; l++) full += row[l] * row[l];
      residual[i] = h[which[i]] - (level ? level[i] : 0);
      for (int j = 0; j < k; j++) {
        int other = kept[j];
        if (r->s->component[which[other]] != r->s->component[which[i]]) continue;
        const double *base = rows + (int64_t)other * n_of(r);
        double s = 0;
        for (int l = 0; l < nd; l++) s += row[l] * base[l];
        s /= size[other];
        for (int l = 0; l < nd; l++) row[l] -= s * base[l];
        residual[i] -= s * residual[other];
      }
      size[i] = 0;
      for (int l = 0; l < nd; l++) size[i] += row[l] * row[l];
      if (size[i] > 1e-24 * full) kept[k++] = i;
    }
    for (int j = 0; j < k; j++) {
      const double *row = rows + (int64_t)kept[j] * n_of(r);
      double f = residual[kept[j]] / size[kept[j]];
      if (f != 0) for (int l = 0; l < nd; l++) r->x[l] -= f * row[l];
    }
  }
}

static void project(Run *r, const int32_t *which, int count) { project_to(r, which, count, 0); }

/* Functions that a mode keeps at zero: surfaces, gaps and their rates. */
static int kept_by(const Run *r, const int8_t *letter, int32_t *which) {
  int count = 0;
  for (int i = 0; i < width_of(r); i++) if (letter[i] == 0) which[count++] = i;
  for (int i = m_of(r); i < width_of(r); i++) if (letter[i] == 0) which[count++] = i + c_of(r);
  return count;
}

/* Whether Newton's steps have led onto a surface: not where its zero is a multiple one. */
static int is_on(Run *r, int surface) {
  double h = surface_values(r, r->x)[surface];
  return fabs(h) <= VANISHES * surface_scales(r, r->x)[surface];
}

/* Gaps and rates that are zero to rounding are so, in r->rates. */
static const double *gaps(Run *r, const double *x) {
  surface_values(r, x);
  const double *scale = surface_scales(r, x);
  for (int i = m_of(r); i < m_of(r) + 2 * c_of(r); i++) if (fabs(r->rates[i]) <= ON_SURFACE * scale[i]) r->rates[i] = 0;
  return r->rates + m_of(r);
}

/* Surfaces through the present state, to rounding, and contacts at rest; those that slide in a mode and the
 * ``certain`` one (or -1). The run ends where a gap is negative. */
static int is_met(Run *r, const int8_t *letter, int set, const double *h, const double *scales_of);

static void active_surfaces(Run *r, int certain, const int8_t *letter) {
  r->active_count = 0;
  if (!width_of(r)) return;
  surface_values(r, r->x);
  const double *scale = surface_scales(r, r->x), *h = r->rates;
  for (int j = 0; j < c_of(r); j++) {
    double gap = h[m_of(r) + j];
    if (gap < 0 && !(fabs(gap) <= ON_SURFACE * scale[m_of(r) + j])) finish(r, INCONSISTENT, BEHIND, j);
  }
  int met = 0;
  for (int i = 0; i < width_of(r); i++) {
    int rests = fabs(h[i]) <= ON_SURFACE * scale[i];
    if (i >= m_of(r)) rests &= fabs(h[i + c_of(r)]) <= ON_SURFACE * scale[i + c_of(r)];
    int s = set_of(r, i), sure = i == certain;
    if (s >= 0) {
      int f = r->s->set_first[s];
      if (i == f) met = letter[f] <= OFF && is_met(r, letter, s, h, scale);
      rests = met;
      sure = certain >= f && certain < f + r->s->set_size[s];
    }
    if (rests || letter[i] == 0 || sure) r->active[r->active_count++] = i;
  }
}
