/* Elements: those that are active at a state, the functions that they keep at zero, and their laws. The unknown nu is in
 * [-n, n] for a surface, in [0, inf) for a contact or a complementarity condition, |nu| <= n for vectors of a set (sets.c),
 * and h^(degree) in its normal cone. LAWS has the differences between the laws; decide.c solves them.
 */

/* Surfaces, gaps, their rates and lower derivatives at x; gradients remain among the program's values. */
static const double *surface_values(Run *r, const double *x) {
  const Values *t = &r->s->surfaces;
  values_at(t, x, r->p, r->heights);
  for (int i = 0; i < r->kept_rows; i++) r->rates[i] = out_of(t, r->heights, i);
  return r->rates;
}

/* Rounding in each of them, times epsilon, after surface_values. */
static const double *surface_scales(Run *r, const double *x) {
  double *near = r->vector, *scale = r->rates + r->kept_rows;
  weigh_state(r, x, near);
  kept_sums(r, near, scale);
  return scale;
}

/* Least-norm Newton steps of the states (not the time) onto functions that are kept at zero: overlapping rows are
 * orthogonalised one after the other; dependent rows drop out. */
static void project_to(Run *r, const int32_t *which, int count, const double *level) {
  const Entries *g = &r->s->surface_gradient;
  int all = r->kept_rows, more = r->s->combined, nd = r->s->dimension;
  double *rows = r->gradient_row, *size = rows + (int64_t)(all + more) * r->n, *residual = size + all + more;
  for (int iteration = 0; count && iteration < 3; iteration++) {
    int any = 0, k = 0;
    const double *h = surface_values(r, r->x);
    int32_t *row_at = r->pending, *kept = row_at + all + more;
    for (int i = 0; i < all + more; i++) row_at[i] = -1;
    for (int i = 0; i < count; i++) {
      row_at[which[i]] = i;
      residual[i] = (which[i] < all ? h[which[i]] : hidden_value(r, which[i] - all, h)) - (level ? level[i] : 0);
      any |= residual[i] != 0;
    }
    if (!any) break;
    memset(rows, 0, sizeof(double) * count * r->n);
    for (int q = 0; q < g->count; q++) {
      double slope = out_of(&r->s->surfaces, r->heights, all + q);
      if (g->column[q] >= nd) continue;
      if (row_at[g->row[q]] >= 0) rows[(int64_t)row_at[g->row[q]] * r->n + g->column[q]] = slope;
      for (int i = 0; i < more; i++)
        for (int j = 0; j < r->equations.count && r->equations.own[i] == g->row[q]; j++) {
          int to = row_at[all + r->equations.row[j]];
          if (to >= 0) rows[(int64_t)to * r->n + g->column[q]] += weights_of(r)[(more + r->equations.row[j]) * more + i] * slope;
        }
    }
    for (int i = 0; i < count; i++) {
      double *row = rows + (int64_t)i * r->n, full = 0;
      for (int l = 0; l < nd; l++) full += row[l] * row[l];
      for (int j = 0; j < k; j++) {
        int other = kept[j];
        if (which[i] < all && which[other] < all && r->s->component[which[other]] != r->s->component[which[i]]) continue;
        const double *base = rows + (int64_t)other * r->n;
        double s = 0;
        for (int l = 0; l < nd; l++) s += row[l] * base[l];
        s /= size[other];
        for (int l = 0; l < nd; l++) row[l] -= s * base[l];
        residual[i] -= s * residual[other];
      }
      size[i] = 0;
      for (int l = 0; l < nd; l++) size[i] += row[l] * row[l];
      if (size[i] > DEPENDENT * full) kept[k++] = i;
    }
    for (int j = 0; j < k; j++) {
      const double *row = rows + (int64_t)kept[j] * r->n;
      double f = residual[kept[j]] / size[kept[j]];
      if (f != 0) for (int l = 0; l < nd; l++) r->x[l] -= f * row[l];
    }
  }
}

static void project(Run *r, const int32_t *which, int count) { project_to(r, which, count, 0); }

/* Rows of the derivatives that an element keeps at zero too; their number. */
static int lower_rows(const Run *r, int i, int32_t *which) {
  const Element *e = element(r, i);
  for (int k = 0; k < e->degree - 1; k++) which[k] = e->lower + k;
  return e->degree > 1 ? e->degree - 1 : 0;
}

/* Whether an element keeps its function at zero, as one of the states. */
static int keeps_height(const Run *r, int i) { return element(r, i)->degree > 0; }

/* The side to which a motion on h = 0 passes by the first lower derivative that is not zero to rounding; 0 where all
 * are. After surface_values and surface_scales. */
static int passes_to(const Run *r, int i, const double *scale) {
  const Element *e = element(r, i);
  for (int k = e->lower; k < e->lower + e->degree - 1; k++)
    if (!(fabs(r->rates[k]) <= ON_SURFACE * scale[k])) return r->rates[k] > 0 ? 1 : -1;
  return 0;
}

/* Set letters of the surfaces that the motion passes by a lower derivative: the ``certain`` one (or -1) and those that are
 * zero to rounding. */
static void take_sides(Run *r, int8_t *letter, int certain) {
  int needed = 0;
  for (int i = 0; i < r->m; i++) needed |= degree_of(r, i) > 1;
  if (!needed) return;
  surface_values(r, r->x);
  const double *scale = surface_scales(r, r->x);
  for (int i = 0; i < r->m; i++) {
    if (degree_of(r, i) <= 1 || letter[i] == 0 || !(i == certain || fabs(r->rates[i]) <= ON_SURFACE * scale[i])) continue;
    int side = passes_to(r, i, scale);
    if (side) letter[i] = (int8_t)side;
  }
}

/* Add the functions of joints and their derivatives. */
static int with_joints(const Run *r, int32_t *which, int count) {
  for (int i = 0; r->s->joints && i < r->m; i++) if (has_law(r, i, JOINT_LAW)) which[count++] = i;
  for (int i = 0; r->s->joints && i < r->m; i++) if (has_law(r, i, JOINT_LAW)) count += lower_rows(r, i, which + count);
  return count;
}

/* Functions that the active elements below ``width`` keep at zero, contacts their gaps, and the ``certain`` one (or -1),
 * also if it is passed. */
static int gather(const Run *r, int certain, int width, int32_t *which) {
  int count = 0, found = certain < 0 || degree_of(r, certain) <= 1;
  for (int i = 0; i < r->active_count && r->active[i] < width; i++) {
    if (keeps_height(r, r->active[i])) which[count++] = r->active[i];
    found |= r->active[i] == certain;
  }
  if (!found) which[count++] = certain;
  for (int i = 0; i < r->active_count; i++)
    if (r->active[i] < r->m) count += lower_rows(r, r->active[i], which + count);
  return with_joints(r, which, count);
}

/* Functions that a mode keeps at zero, and derivatives. */
static int kept_by(Run *r, const int8_t *letter, int32_t *which) {
  int count = 0;
  combine_rows(r, letter, r->x);
  for (int i = 0; i < r->width; i++) if (letter[i] == 0 && keeps_height(r, i)) which[count++] = i;
  for (int i = 0; i < r->width; i++) if (letter[i] == 0) count += lower_rows(r, i, which + count);
  for (int k = 0; k < r->equations.count; k++) which[count++] = r->kept_rows + r->equations.row[k];
  return count;
}

/* Whether a state satisfies the equations of a mode. */
static int satisfies(Run *r, const int8_t *letter) {
  if (!r->s->combined) return 1;
  combine_rows(r, letter, r->x);
  const double *h = surface_values(r, r->x), *scale = surface_scales(r, r->x);
  for (int k = 0; k < r->equations.count; k++) {
    int row = r->equations.row[k];
    if (!(fabs(hidden_value(r, row, h)) <= (TIED + r->equations.off) * hidden_scale(r, row, scale))) return 0;
  }
  return 1;
}

/* Whether a surface depends on the time alone, so that no step of the states reaches it. */
static int is_of_time(const Run *r, int surface) {
  const Entries *g = &r->s->surface_gradient;
  for (int k = 0; k < g->count; k++) if (g->row[k] == surface && g->column[k] < r->s->dimension) return 0;
  return 1;
}

/* Whether Newton steps have reached a surface; they fail where its zero is multiple. */
static int is_on(Run *r, int surface) {
  if (is_of_time(r, surface)) return 1;
  double h = surface_values(r, r->x)[surface];
  return fabs(h) <= VANISHES * surface_scales(r, r->x)[surface];
}

/* Gaps and rates in r->rates, set to zero where they are zero to rounding. */
static const double *gaps(Run *r, const double *x) {
  surface_values(r, x);
  const double *scale = surface_scales(r, x);
  for (int i = r->m; i < r->m + 2 * r->c; i++) if (fabs(r->rates[i]) <= ON_SURFACE * scale[i]) r->rates[i] = 0;
  return r->rates + r->m;
}

/* Keep active surfaces that Newton steps from the others reach within rounding of the states. A nearly parallel surface is
 * passed separately, at its nearer root first. */
static void leave_parallel(Run *r, int certain, const int8_t *letter) {
  double *x = r->before, *first = r->at_work;
  int32_t *onto = r->involved;
  int count = 0, kept = 0;
  for (int i = 0; i < r->active_count; i++) {
    int own = r->active[i];
    if (letter[own] == 0 || own == certain) {
      if (keeps_height(r, own)) onto[kept++] = own;
    } else count += has_law(r, own, SURFACE_LAW);
  }
  if (!count) return;
  kept = with_joints(r, onto, kept);
  memcpy(x, r->x, sizeof(double) * r->n);
  project(r, onto, kept);
  memcpy(first, r->x, sizeof(double) * r->n);
  count = 0;
  for (int i = 0; i < r->active_count; i++) {
    int own = r->active[i], is_near = 1;
    if (has_law(r, own, SURFACE_LAW) && letter[own] != 0 && own != certain) {
      memcpy(r->x, first, sizeof(double) * r->n);
      onto[kept] = own;
      project(r, onto, kept + 1);
      for (int q = 0; q < r->n; q++) is_near &= fabs(r->x[q] - first[q]) <= PARALLEL * (r->size + fabs(first[q]));
    }
    if (is_near) r->active[count++] = own;
  }
  r->active_count = count;
  memcpy(r->x, x, sizeof(double) * r->n);
}

/* End the run where a state does not satisfy a joint, or does not move along it. */
static void require_joints(Run *r, const double *scale) {
  for (int i = 0; r->s->joints && i < r->m; i++) {
    const Element *e = element(r, i);
    for (int k = 0; has_law(r, i, JOINT_LAW) && k < e->degree; k++) {
      int row = k ? e->lower + k - 1 : i;
      if (fabs(r->rates[row]) <= CONSISTENT * scale[row] || r->status != RUNNING) continue;
      r->limit = r->rates[row];
      finish(r, INCONSISTENT, OFF_CONSTRAINT, k ? r->m + i : i);
    }
  }
}

/* Set letters of sets without load to IDLE. */
static void idle_sets(const Run *r, int8_t *letter, const double *scale) {
  EACH_SET(r, s) if (is_unloaded(r, letter, s, scale)) memset(letter + s, IDLE, size_of(r, s));
}

/* List active elements: surfaces through the present state, to rounding, contacts at rest, those that slide in a mode and
 * the ``certain`` one (or -1). The run ends where a gap is negative. */
static void active_surfaces(Run *r, int certain, const int8_t *letter) {
  r->active_count = 0;
  if (!r->width) return;
  surface_values(r, r->x);
  const double *scale = surface_scales(r, r->x), *h = r->rates;
  for (int j = 0; j < r->c; j++) {
    double gap = h[r->m + j];
    if (gap < 0 && !(fabs(gap) <= ON_SURFACE * scale[r->m + j])) finish(r, INCONSISTENT, BEHIND, j);
  }
  require_joints(r, scale);
  int reached = 0;
  for (int i = 0; i < r->width; i++) {
    int rests = fabs(h[i]) <= ON_SURFACE * scale[i], s = set_of(r, i), sure = i == certain;
    if (has_law(r, i, RELAY_LAW) || has_law(r, i, JOINT_LAW) || has_law(r, i, TABLE_LAW)) continue; /* nothing is decided */
    rests |= !keeps_height(r, i); /* its function contains unknowns: it is decided with them */
    if (s >= 0) {
      if (i == s) reached = letter[s] <= OFF && !is_unloaded(r, letter, s, scale) && is_reached(r, letter, s, h, scale);
      rests = reached;
      sure = certain >= s && certain < s + size_of(r, s);
    }
    if (letter[i] != 0 && passes_to(r, i, scale)) continue; /* its letter follows from a lower derivative */
    if (rests || letter[i] == 0 || sure) r->active[r->active_count++] = i;
  }
  if (certain >= 0 && has_law(r, certain, SURFACE_LAW)) leave_parallel(r, certain, letter);
}

/* Laws -------------------------------------------------------------------------------------------------- */

/* The sign of a bound's first coefficient that is nonzero to rounding. */
static double turn_of(const Run *r, int i, const double *factor, int count) {
  const Entries *g = &r->s->factor_gradient;
  int k = 0;
  while (k < count && factor[k] == 0) k++;
  if (k == 0 && count > 1 && factor[0] * factor[1] < 0) {
    double rounding = 0;
    for (int e = 0; e < g->count; e++) {
      double slope = fabs(out_of(&r->s->point, r->point, first_of_factors(r) + e));
      if (g->row[e] == i && slope < INFINITY) rounding += slope * fabs(r->expansion->states[(int64_t)g->column[e] * r->stride]);
    }
    k = fabs(factor[0]) <= VANISHES * rounding;
  }
  return k < count ? ns_sign(factor[k]) : 1;
}

static void lay_out_surface(const Run *r, Layout *l, int i) {
  (void)r;
  if (l->letter[i]) add_row(l, SURFACE_GUARD, i, l->letter[i]);
  else { add_row(l, EXIT_GUARD, i, 1); add_row(l, EXIT_GUARD, i, -1); }
}

/* Of contacts and complementarity. */
static void lay_out_half_line(const Run *r, Layout *l, int i) {
  int open = has_law(r, i, CONTACT_LAW) ? IMPACT_GUARD : SURFACE_GUARD;
  add_row(l, l->letter[i] ? open : RELEASE_GUARD, i, l->letter[i]);
}

/* A function on its side, also a gap. */
static void guard_of_height(Run *r, const Layout *l, int row, int count, double *g) {
  const double *h = row_of(r, r->n + r->width + l->index[row]);
  for (int k = 0; k < count; k++) g[k] = l->side[row] * h[k];
}

static void guard_of_surface(Run *r, const Layout *l, int row, const double *series, int count, double *g) {
  int i = l->index[row], side = l->side[row];
  if (l->kind[row] == SURFACE_GUARD) { guard_of_height(r, l, row, count, g); return; }
  if (is_idle(r, l->letter, i)) {
    const double *layer = row_of(r, r->n + i);
    for (int k = 0; k < count; k++) g[k] = -side * layer[k];
    return;
  }
  const double *factor = row_of(r, r->n + 2 * r->width + i), *lam = series + (int64_t)i * r->stride;
  double turn = turn_of(r, i, factor, count);
  for (int k = 0; k < count; k++) g[k] = turn * (factor[k] - side * lam[k]);
}

/* Of contacts and complementarity: the function while open, the unknown while closed. */
static void guard_of_half_line(Run *r, const Layout *l, int row, const double *series, int count, double *g) {
  if (l->letter[l->index[row]]) guard_of_height(r, l, row, count, g);
  else memcpy(g, series + (int64_t)l->index[row] * r->stride, sizeof(double) * count);
}

/* Rounding of h off its zero, of the rate of h or of the reaction on it. */
static double rounding_of_element(Run *r, const Expansion *e, int row, const Sums *of) {
  (void)r;
  int i = e->l.index[row];
  return e->l.letter[i] ? of->height[i] : of->layer[i];
}

static int8_t side_of_surface(const Run *r, int i, double h) {
  (void)r, (void)i;
  return h > 0 ? 1 : -1; /* on it counts as below until decided */
}

static int8_t side_of_one(const Run *r, int i, double h) {
  (void)r, (void)i, (void)h;
  return 1;
}

/* The guard of a relay. At its threshold, or beyond by rounding, it counts as just before: the motion switches it or
 * leaves. */
static void guard_of_relay(Run *r, const Layout *l, int row, const double *series, int count, double *g) {
  (void)series;
  guard_of_height(r, l, row, count, g);
  if (count > 1 && !(g[0] > 0)) g[0] = SMALLEST;
}

/* On above the upper threshold, off below the lower one, and as it is between them. */
static int8_t side_of_relay(const Run *r, int i, double h) {
  return r->rates[element(r, i)->lower] > 0 ? 1 : h < 0 ? -1 : r->letter[i] > 0 ? 1 : -1;
}

/* Relays whose switching times coincide to rounding switch together. */
static void serve_relay(Run *r, int row) {
  int before = r->mode;
  double last = r->root_at[row] + TIE * time_scale(r);
  for (int k = 0; k < r->now.atoms; k++) {
    int i = r->now.index[k];
    if (has_law(r, i, RELAY_LAW) && r->root_at[k] >= 0 && r->root_at[k] <= last) r->letter[i] = (int8_t)-r->letter[i];
  }
  settle_in(r);
  if (r->status == RUNNING) event(r, change_kind(r, before, r->mode), before, row, r->x);
}

/* A joint keeps its function at zero with a reaction of any size and sign, always. */
static int8_t side_of_joint(const Run *r, int i, double h) {
  (void)r, (void)i, (void)h;
  return 0;
}

/* Tables: the cell of the function between breakpoints sets parameters of the field, which is continuous ---------- */

static const Cells *cells_of(const Run *r, int i) { return r->s->cells + i; }

static void set_cell(Run *r, int i, int cell) {
  const Cells *t = cells_of(r, i);
  if (r->cell[i] == cell) return;
  r->cell[i] = cell;
  memcpy(r->p + t->first, t->value + (int64_t)cell * t->size, sizeof(double) * t->size);
  r->now.mode = r->e.l.mode = r->trial.l.mode = -1;
  forget_rows(r);
  prepare(r);
}

static int cell_at(const Cells *t, double h) {
  int low = 0, high = t->count;
  while (low < high) {
    int middle = (low + high) / 2;
    if (h < t->level[middle]) high = middle; else low = middle + 1;
  }
  return low;
}

/* The breakpoint at a side of the present cell, or -1. */
static int breakpoint(const Run *r, int i, int side) {
  int k = side > 0 ? r->cell[i] - 1 : r->cell[i];
  return k < cells_of(r, i)->count ? k : -1;
}

static int is_at_level(const Run *r, int i, int side, double h) {
  int k = breakpoint(r, i, side);
  double level = k < 0 ? 0 : cells_of(r, i)->level[k];
  return k >= 0 && fabs(h - level) <= ON_SURFACE * (r->size + fabs(h) + fabs(level));
}

/* At an end of a table the state is in the inner cell, which its motion may leave. */
static void enter_limits(Run *r, int i, double h) {
  const int32_t *q = cells_of(r, i)->limit;
  for (int k = 0; k < cells_of(r, i)->limits; k++, q += 3 + 2 * q[2]) {
    int side = r->cell[i] == q[1] + 1 ? 1 : r->cell[i] == q[0] - 1 ? -1 : 0;
    if (side && is_at_level(r, i, side, h)) set_cell(r, i, r->cell[i] - side);
  }
}

/* Find the cells of a state; a present cell is kept to rounding. */
static void find_cells(Run *r) {
  for (int i = 0; r->s->tables && i < r->m; i++) {
    if (!has_law(r, i, TABLE_LAW)) continue;
    double value = surface_values(r, r->x)[i];
    int known = r->cell[i] >= 0 && (is_at_level(r, i, 1, value) || is_at_level(r, i, -1, value));
    if (known) continue;
    set_cell(r, i, cell_at(cells_of(r, i), value));
    enter_limits(r, i, value);
  }
}

/* End the run where the function of an active table has left its limits, unless it has ended. */
static void require_limits(Run *r) {
  double gone = time_scale(r);
  int ends = gone > 0 && r->t >= r->o.t_end - TIE * gone;
  for (int i = 0; r->s->tables && !ends && i < r->m; i++) {
    const int32_t *q = has_law(r, i, TABLE_LAW) ? cells_of(r, i)->limit : 0;
    for (int k = 0; q && k < cells_of(r, i)->limits; k++, q += 3 + 2 * q[2]) {
      int out = r->cell[i] < q[0] || r->cell[i] > q[1];
      for (int j = 0; j < q[2]; j++) out &= r->letter[q[3 + 2 * j]] != -q[4 + 2 * j];
      if (out) finish(r, NOT_FINITE, OUT_OF_TABLE, i);
    }
  }
}

/* The mode with the present letters and cells. */
static void renumber(Run *r) {
  lay_out(r, r->letter, &r->now);
  r->mode = r->now.mode;
  r->shown = shown_number(r, r->letter);
  enter_segment(r, r->shown);
  require_limits(r);
}

/* Put a state at a breakpoint into the cell that its motion enters. */
static void turn_cells(Run *r) {
  int turned = 0, is_known = 0;
  const double *h = surface_values(r, r->x);
  for (int i = 0; r->s->tables && r->status == RUNNING && i < r->m; i++)
    for (int side = -1; side <= 1 && has_law(r, i, TABLE_LAW); side += 2) {
      if (!is_at_level(r, i, side, h[i])) continue;
      double value = 0;
      if (!is_known) expand(r, r->letter, r->x, r->unknowns, &r->e);
      is_known = 1;
      h = surface_values(r, r->x);
      for (int row = 0; row < r->now.atoms; row++)
        if (r->now.index[row] == i && r->now.side[row] == side) leading(r, &r->e, row, 1, &value);
      if (value < 0) { set_cell(r, i, r->cell[i] - side); turned = 1; break; }
    }
  if (turned) renumber(r);
}

/* Tables whose breakpoints coincide with a guard to rounding pass with it, as does its own. */
static void pass_cells(Run *r, int row) {
  double last = r->root_at[row] + TIE * time_scale(r);
  const double *h = r->s->tables ? surface_values(r, r->x) : 0;
  for (int k = 0; r->s->tables && k < r->now.atoms; k++) {
    int i = r->now.index[k], side = r->now.side[k];
    if (!has_law(r, i, TABLE_LAW)) continue;
    int tied = r->root_at[k] >= 0 && r->root_at[k] <= last && is_at_level(r, i, side, h[i]);
    if (k == row) r->passed = breakpoint(r, i, side);
    if (k == row || tied) set_cell(r, i, r->cell[i] - side);
    if (k == row || tied) h = surface_values(r, r->x);
  }
}

static void lay_out_table(const Run *r, Layout *l, int i) {
  (void)r;
  add_row(l, SURFACE_GUARD, i, 1);
  add_row(l, SURFACE_GUARD, i, -1);
}

static void guard_of_table(Run *r, const Layout *l, int row, const double *series, int count, double *g) {
  int i = l->index[row], side = l->side[row], k = breakpoint(r, i, side);
  (void)series;
  guard_of_height(r, l, row, count, g);
  if (k < 0) { /* none: as far as can be */
    memset(g, 0, sizeof(double) * count);
    g[0] = 1;
    return;
  }
  int is_at = count > 1 && is_at_level(r, i, side, side * g[0]);
  g[0] = is_at ? 0 : g[0] - side * cells_of(r, i)->level[k];
}

static void serve_table(Run *r, int row) {
  int before = r->mode, i = r->now.index[row], count = kept_by(r, r->letter, r->involved);
  memset(r->levels, 0, sizeof(double) * count);
  r->involved[count] = i;
  r->levels[count] = cells_of(r, i)->level[r->passed];
  project_to(r, r->involved, count + 1, r->levels);
  renote(r);
  renumber(r);
  strike_due(r);
  if (cells_of(r, i)->shown[r->passed] >= 0) event(r, CROSSING, before, row, r->x);
}

/* Number in results of the function whose guard ended the mode. */
static int shown_index(const Run *r) {
  int i = r->guard.index;
  if (is_atom(r->guard.kind)) return i;
  return element(r, i)->shown + (has_law(r, i, TABLE_LAW) ? cells_of(r, i)->shown[r->passed] : 0);
}

static const Law LAWS[] = {
  [SURFACE_LAW] = {lay_out_surface, guard_of_surface, rounding_of_element, side_of_surface, serve_surface},
  [CONTACT_LAW] = {lay_out_half_line, guard_of_half_line, rounding_of_element, side_of_one, serve_half_line},
  [COMPLEMENTARITY_LAW] = {lay_out_half_line, guard_of_half_line, rounding_of_element, side_of_one, serve_half_line},
  [SET_LAW] = {lay_out_set, guard_of_set, rounding_of_set, side_of_set, serve_set},
  [RELAY_LAW] = {lay_out_surface, guard_of_relay, rounding_of_element, side_of_relay, serve_relay},
  [JOINT_LAW] = {.side = side_of_joint},
  [TABLE_LAW] = {lay_out_table, guard_of_table, rounding_of_element, side_of_one, serve_table},
};

static const Law *law_of(const Run *r, int i) { return LAWS + element(r, i)->law; }
