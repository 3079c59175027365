/* The loop: expand, locate, check, advance, process events ----------------------------------------------- */

static int change_kind(const Run *r, int before, int after) {
  const int8_t *one = r->table->letter + (int64_t)before * r->table->width;
  const int8_t *two = r->table->letter + (int64_t)after * r->table->width;
  int closed = 0, slides = 0;
  for (int i = 0; i < r->width; i++)
    if (is_half_line(r, i)) closed += (two[i] == 0) - (one[i] == 0);
    else slides += (two[i] == 0) - (one[i] == 0);
  if (closed) return closed > 0 ? CONTACT : RELEASE;
  return slides > 0 ? ENTRY : slides < 0 ? EXIT : CROSSING;
}

/* Whether results show another mode as the present one: near a set and far from it are the same. */
static int is_alike(const Run *r, const int8_t *letter) {
  if (!r->s->sets) return 0;
  for (int i = 0; i < r->width; i++)
    if (letter[i] != (r->letter[i] == LEFT_BEHIND ? OFF : r->letter[i]) && letter[i] != r->letter[i]) return 0;
  return 1;
}

static void adopt(Run *r, const Continuation *c) {
  r->due_impact = -1; /* a row of the mode before */
  int alike = is_alike(r, c->letter);
  memcpy(r->letter, c->letter, r->width);
  memcpy(r->drop, c->drop, sizeof(int32_t) * r->guards);
  memcpy(r->unknowns, c->unknowns, sizeof(double) * r->width);
  enter_mode(r);
  if (alike) return;
  int shown = shown_number(r, r->letter);
  if (r->s->sets && shown == r->shown) { /* a set is passed again: another stretch, of the same letters */
    int8_t *letter = (int8_t *)r->heights_of;
    for (int i = 0; i < r->width; i++) letter[i] = r->letter[i] == LEAVING ? LEAVING_AGAIN : r->letter[i];
    shown = shown_number(r, letter);
  }
  r->shown = shown;
  enter_segment(r, shown);
  require_limits(r);
}

/* A surface that would come to rest though its multiplier enters only its third derivative or a later one: motions
 * leave such a point by infinitely many switchings. -1 if there is none. */
static int rests_unstably(const Run *r, const int8_t *letter) {
  for (int i = 0; i < r->m; i++) if (degree_of(r, i) > 2 && letter[i] == 0 && r->letter[i] != 0) return i;
  return -1;
}

/* A surface that would come to rest beside one whose multiplier has the same destabilising sign in its rate and its second
 * derivative: motions leave such a point in infinitely many growing turns. -1 if there is none. */
static int spirals_out(Run *r, const int8_t *letter) {
  int w = r->width, is_read = 0;
  for (int i = 0; i < r->m; i++)
    for (int j = 0; j < r->m && !letter[i] && degree_of(r, i) == 2; j++) {
      if (letter[j] || degree_of(r, j) != 1) continue;
      if (!has_law(r, i, SURFACE_LAW) || !has_law(r, j, SURFACE_LAW) || !(r->letter[i] || r->letter[j])) continue;
      if (!is_read++) {
        aim(r, letter, r->x, r->chosen.unknowns);
        error_scales(r, r->x, held_of(r, letter), r->chosen.unknowns);
      }
      double own = r->slope[i * w + i] * r->slope[j * w + j], crossed = r->slope[i * w + j] * r->slope[j * w + i];
      if (r->slope[j * w + j] * factor_of(r, j) > 0 && own != 0 && fabs(own - crossed) <= TIED * fabs(own)) return i;
    }
  return -1;
}

/* Enter the only mode that can continue; 0 where there is none or more than one. */
static int choose(Run *r, const int8_t *letter, const Known *known, int known_count) {
  if (r->active_count) {
    if (!decide(r, letter, known, known_count)) return 0;
    int unstable = rests_unstably(r, r->chosen.letter);
    if (unstable >= 0) { finish(r, NON_UNIQUE, HIGH_DEGREE, unstable); return 0; }
    unstable = spirals_out(r, r->chosen.letter);
    if (unstable >= 0) { finish(r, NON_UNIQUE, SPIRAL_OUT, unstable); return 0; }
    if (leaves_by_root(r)) { finish(r, NON_UNIQUE, AMBIGUOUS, 0); return 0; }
  } else {
    memcpy(r->chosen.letter, letter, r->width);
    if (r->s->sets) idle_sets(r, r->chosen.letter, 0);
    memset(r->chosen.drop, 0, sizeof(int32_t) * r->guards);
    keep_carried(r, r->chosen.letter, r->chosen.unknowns);
    if (r->s->joints && !hold(r, &r->chosen, 0)) return 0;
  }
  adopt(r, &r->chosen);
  return 1;
}

/* Letters of all elements off their zeros. */
static int letters_of(Run *r, int8_t *letter) {
  if (!r->width) return 1;
  const double *h = surface_values(r, r->x);
  int finite = finite_all(h, r->m + 2 * r->c);
  for (int i = 0; i < r->width; i++) letter[i] = law_of(r, i)->side(r, i, h[i]);
  if (r->s->sets && r->c) idle_sets(r, letter, surface_scales(r, r->x));
  take_sides(r, letter, -1);
  return finite;
}

/* Apply an impact at a closed gap with negative rate; a gap that opens has a known zero. */
static void strike_due(Run *r) {
  if (!r->c || r->status != RUNNING) return;
  const double *gap = gaps(r, r->x), *rate = gap + r->c;
  r->due_impact = -1;
  for (int row = 0; row < r->now.rows; row++) {
    int j = r->now.index[row] - r->m;
    if (r->now.kind[row] != IMPACT_GUARD || gap[j] != 0) continue;
    if (rate[j] < 0) r->due_impact = row;
    else if (rate[j] > 0) r->drop[row] = 1;
  }
}

/* Find the mode of a state after a jump; whether complementarity conditions made it jump again. */
static int settle_in(Run *r) {
  Guard guard = r->guard;
  int before = r->mode, jumped = become_consistent(r);
  find_cells(r);
  letters_of(r, r->start);
  active_surfaces(r, -1, r->start);
  if (r->status != RUNNING) return jumped;
  choose(r, r->start, 0, 0);
  turn_cells(r);
  strike_due(r);
  if (jumped) event(r, JUMP, before, 0, r->jumped_from);
  r->guard = guard;
  return jumped;
}

/* Whether a run can start in a mode, by the guards of its active elements. Repelling sliding is accepted. */
static int can_start(Run *r) {
  Expansion *e = &r->e;
  int holds = 1;
  expand(r, r->letter, r->x, r->unknowns, e);
  r->turned_mode = r->mode;
  for (int row = 0; row < e->l.rows; row++) {
    int kind = e->l.kind[row], index = e->l.index[row];
    r->turned[row] = e->guards[(int64_t)row * r->stride] < 0 ? -1 : 1;
    int is_of_law = kind == SURFACE_GUARD || kind == EXIT_GUARD || kind == SLIP_GUARD || kind == NEAR_GUARD;
    if (!is_of_law && !(kind == RELEASE_GUARD && has_law(r, index, COMPLEMENTARITY_LAW))) continue;
    if (kind == NEAR_GUARD && r->letter[index] == 0) continue; /* ends steps only */
    if (!is_active(r, index)) continue;
    double value;
    r->drop[row] = leading(r, e, row, kind == SURFACE_GUARD || kind == NEAR_GUARD, &value);
    holds &= value >= 0; /* of sliding from which both sides lead away, too */
  }
  return holds;
}

/* Unknowns of the motion in an asked mode that does not determine them; whether there is one. */
static int unknowns_by_law(Run *r, const int8_t *letter) {
  Decision *d = r->decision;
  r->equations.is_raw = 1;
  if (begin_law(r, letter, 0, 0)) {
    memset(d->is_touched, 1, d->count);
    explore(r, d, 0, 0);
  }
  r->equations.is_raw = 0;
  for (int q = 0; q < d->motions && r->status == RUNNING; q++) {
    letters_of_motion(r, d, d->motion + q, r->chosen.letter);
    if (memcmp(r->chosen.letter, letter, r->width)) continue;
    choose_motion(r, d, d->motion + q);
    memcpy(r->unknowns, r->chosen.unknowns, sizeof(double) * r->width);
    return r->status == RUNNING;
  }
  return 0;
}

static void start_in(Run *r, const int8_t *asked) {
  int8_t *letter = r->start;
  for (int i = 0; i < r->width; i++) {
    int active = is_active(r, i);
    letter[i] = asked[i];
    if (set_of(r, i) >= 0 && asked[i] == OFF) letter[i] = active ? LEAVING : r->letter[i] == IDLE ? IDLE : OFF;
    if (!active && letter[i] != r->letter[i]) { finish(r, NON_UNIQUE, WRONG_START, r->mode); return; }
  }
  if (r->s->sets) idle_sets(r, letter, 0);
  memcpy(r->letter, letter, r->width);
  enter_mode(r);
  if (r->s->joints || r->s->sets) find_dependent(r, &r->now, r->letter, r->unknowns);
  int by_law = r->s->sets && r->active_count && r->dependent == r->mode && unknowns_by_law(r, letter);
  int found = by_law ? 1 : r->status == RUNNING ? find_unknowns(r, &r->now) : 1;
  if (found != 1) { finish(r, NON_UNIQUE, START_SOLUTIONS, found); return; }
  if (r->status == RUNNING && !can_start(r)) finish(r, NON_UNIQUE, IMPOSSIBLE_START, 0);
}

/* The time scale: in it the states change by their own size at the rates of the start. */
static void measure_time(Run *r) {
  double unit = r->o.t_end - r->t;
  r->time_size = r->size;
  if (!r->s->timed) return;
  aim(r, r->letter, r->x, r->unknowns);
  set_inputs(r, r->x, held_of(r, r->letter), r->unknowns);
  first_values(r, 0);
  for (int i = 0; i < r->s->dimension; i++) unit = smaller((r->size + fabs(r->x[i])) / fabs(row_of(r, i)[0]), unit);
  if (unit > 0 && unit < INFINITY) r->time_size = unit;
}

static void begin(Run *r, const int8_t *start_mode, const double *motion) {
  note(r);
  find_idle(r);
  if (start_mode || r->remembered) memcpy(r->letter, start_mode ? start_mode : r->remembered, r->width);
  else memset(r->letter, -1, r->width);
  find_cells(r);
  measure_time(r);
  int finite = letters_of(r, r->letter);
  enter_mode(r);
  int before = r->mode, jumped = finite && become_consistent(r);
  if (!finite) { finish(r, NOT_FINITE, SURFACE, 0); return; }
  active_surfaces(r, -1, r->letter);
  if (r->status == RUNNING) {
    project(r, r->involved, gather(r, -1, r->m, r->involved));
    renote(r);
    if (start_mode) start_in(r, start_mode);
    else if (r->active_count || r->s->joints) {
      memcpy(r->start, r->letter, r->width);
      choose(r, r->start, 0, 0);
    }
  }
  renumber(r);
  turn_cells(r);
  strike_due(r);
  if (jumped) event(r, JUMP, before, 0, r->jumped_from);
  begin_events(r, motion);
}

/* Functions that are kept at zero, and gaps that the error of the root made negative, by no more than the tolerance. */
static int with_touched(Run *r, int32_t *onto, int kept) {
  int all = kept;
  surface_values(r, r->x);
  const double *scale = surface_scales(r, r->x);
  for (int i = r->m; i < r->m + r->c; i++) {
    int known = 0;
    for (int k = 0; k < kept; k++) known |= onto[k] == i;
    if (!known && r->rates[i] < 0 && r->rates[i] >= -r->o.rtol * scale[i]) onto[all++] = i;
  }
  return all;
}

/* Set rates of contacts to zero that are so after an impact to the rounding of the state before it; their gaps stay. */
static void keep_rates_zero(Run *r, const double *before, int32_t *involved, int count) {
  double *scale = r->small;
  int n = count;
  surface_scales(r, before);
  for (int k = 0; k < count; k++) scale[k] = r->rates[r->kept_rows + rate_row(r, involved[k] += r->m)];
  surface_values(r, r->x);
  for (int k = 0; k < count; k++) {
    int rate = rate_row(r, involved[k]);
    if (r->rates[rate] != 0 && fabs(r->rates[rate]) <= ON_SURFACE * scale[k]) involved[n++] = rate;
  }
  if (n > count) project(r, involved, n);
}

/* Apply the impulses of a gap that closes and of the contacts that are closed. */
static void impact(Run *r, int row) {
  int before = r->mode, contact = r->now.index[row] - r->m, count = 0;
  int32_t *involved = r->involved, *onto = involved, kept = kept_by(r, r->letter, onto);
  double *x = r->before;
  onto[kept++] = r->m + contact; /* what is closed stays so to rounding */
  project(r, onto, kept);
  int more = with_touched(r, onto, kept);
  if (more > kept) project(r, onto, more);
  renote(r);
  memcpy(x, r->x, sizeof(double) * r->n);
  const double *gap = gaps(r, x), *rate = gap + r->c;
  for (int j = 0; j < r->c; j++) if ((gap[j] == 0 && rate[j] <= 0) || j == contact) involved[count++] = j;
  int wrong = improper(r, x, involved, count);
  if (wrong >= 0) { finish(r, INCONSISTENT, RESTITUTION, wrong); return; }
  if (!strike(r, involved, count, 0, r->at_work)) { finish(r, INCONSISTENT, NO_IMPULSE, contact); return; }
  memcpy(r->x, r->at_work, sizeof(double) * r->n);
  keep_rates_zero(r, x, involved, count);
  note(r);
  settle_in(r);
  event(r, IMPACT, before, row, x);
}

static void release(Run *r, int row) {
  int before = r->mode, i = r->now.index[row];
  Known known[] = {{RELEASE_GUARD, i, 0, 1}, {IMPACT_GUARD, i, 1, degree_of(r, i) + 1}};
  if (has_law(r, i, COMPLEMENTARITY_LAW)) known[1].kind = SURFACE_GUARD;
  known[1].zeros += is_held_alone(r, i);
  active_surfaces(r, i, r->letter);
  if (r->status != RUNNING) return;
  memcpy(r->start, r->letter, r->width);
  if (choose(r, r->start, known, 2) && r->mode != before) event(r, change_kind(r, before, r->mode), before, row, r->x);
}

static int only_sliding(const Run *r) {
  int found = -1;
  for (int i = 0; i < r->m; i++)
    if (r->letter[i] == 0 && is_bounded(r, i)) { if (found >= 0) return -1; found = i; }
  return found;
}

static void watch_two_fold(Run *r) {
  int s = only_sliding(r);
  if (s >= 0 && !(r->has_roots && nears_root(r)) && is_two_fold(r, r->letter, s, r->o.rtol)) finish(r, NON_UNIQUE, SLID_TO_TWO_FOLD, s);
}

/* Continue from a guard of a surface or set, where the first coefficients of some guards are known to vanish. */
static void pass(Run *r, int row, const Known *known, int known_count) {
  int kind = r->now.kind[row], index = r->now.index[row], before = r->mode;
  active_surfaces(r, index, r->letter);
  if (r->status != RUNNING) return;
  project(r, r->involved, gather(r, index, r->width, r->involved));
  renote(r);
  if (kind == EXIT_GUARD || kind == BRANCH_GUARD) watch_two_fold(r);
  else if (kind == SURFACE_GUARD && degree_of(r, index) && !is_on(r, index)) finish(r, NON_UNIQUE, MULTIPLE_ZERO, index);
  if (r->status != RUNNING) return;
  memcpy(r->start, r->letter, r->width);
  take_sides(r, r->start, index);
  if (choose(r, r->start, known, known_count) && r->mode != before && !rest_at_limit(r, before))
    event(r, change_kind(r, before, r->mode), before, row, r->x);
}

static void serve_surface(Run *r, int row) {
  int kind = r->now.kind[row], i = r->now.index[row], side = r->now.side[row];
  Known known[] = {{EXIT_GUARD, i, side, 1}, {SURFACE_GUARD, i, side, degree_of(r, i) + 1}};
  pass(r, row, known, kind == EXIT_GUARD ? 2 : 0);
}

static void serve_set(Run *r, int row) {
  int i = r->now.index[row];
  Known known[] = {{SLIP_GUARD, i, 0, 1}, {NEAR_GUARD, i, 0, 2}};
  if (r->now.kind[row] == NEAR_GUARD) near_set(r, row, 1); else pass(r, row, known, 2);
}

static void serve_half_line(Run *r, int row) {
  int kind = r->now.kind[row];
  if (kind == RELEASE_GUARD) release(r, row);
  else if (kind == IMPACT_GUARD) impact(r, row);
  else pass(r, row, 0, 0);
}

static void serve(Run *r, int row) {
  int kind = r->now.kind[row], index = r->now.index[row], side = r->now.side[row];
  r->guard = (Guard){kind, index, side};
  pass_cells(r, row);
  if (kind != BRANCH_GUARD) law_of(r, index)->serve(r, row);
  else if (side == OF_ONE || is_mixed(r, r->now.sliding, r->now.slides)) pass(r, row, 0, 0);
  else {
    event(r, STABILITY, r->mode, row, r->x);
    finish(r, INTERSECTION, STABILITY_LOST, index);
  }
}

/* Advance by a step; 0 where the state after it is not finite: the run then ends before the step. */
static int advance(Run *r, const Expansion *e, double dt) {
  int stride = r->stride, kept = 0;
  double *x = r->at_work;
  for (int i = 0; i < r->s->dimension; i++) x[i] = e->end ? e->end[i] : value_at(e->states + (int64_t)i * stride, r->order, dt);
  if (!finite_all(x, r->s->dimension)) { finish(r, NOT_FINITE, STATE, 0); return 0; }
  if (dt > 0) note_step(r, e);
  if (r->times) sample_step(r, e, dt);
  memcpy(r->x, x, sizeof(double) * r->s->dimension);
  pass_time(r, dt);
  r->since += dt;
  if (e->end) {
    go_on_from(&r->implicit->c, r->implicit->is_end_known);
    r->implicit_count++;
  }
  r->step_count++;
  r->segment_steps++;
  kept = kept_by(r, r->letter, r->involved);
  project(r, r->involved, kept);
  if (r->s->joints) {
    surface_values(r, r->x);
    require_joints(r, surface_scales(r, r->x));
    if (r->status != RUNNING) r->reason = DEAD_POINT;
  }
  if (e->l.slides || r->s->sets) {
    double *ahead = r->lam;
    for (int i = 0; i < r->width; i++) ahead[i] = value_at(e->series + (int64_t)i * stride, r->order, dt);
    memcpy(r->unknowns, ahead, sizeof(double) * r->width);
    improve(r, &r->now, r->x, r->unknowns, 2);
  }
  if (r->s->sets) after_step(r);
  memset(r->drop, 0, sizeof(int32_t) * r->guards);
  note(r);
  return 1;
}

/* A step from a point where only low derivatives exist; guards are evaluated at its end. */
static void leave_singular(Run *r, Expansion *e, double left) {
  int huge = 0;
  for (int i = 0; i < r->n; i++)
    for (int k = 0; k < 2; k++) huge |= fabs(e->states[(int64_t)i * r->stride + k]) > LARGEST;
  double h = singular_step(r, e, smaller(left, r->o.max_step));
  if ((h == 0 || huge) && !ends_at_singular(r)) finish(r, NOT_FINITE, FIELD, 0);
  if (r->status != RUNNING) return;
  if (!advance(r, e, h) || !r->s->rules.atoms) return;
  expand(r, r->letter, r->x, r->unknowns, e);
  for (int a = 0; a < r->s->rules.atoms; a++) /* sides that the start did not have */
    if (!r->instant.side[a]) r->instant.side[a] = (int8_t)ns_sign(e->guards[(int64_t)(e->l.atoms + a) * r->stride]);
}

/* A step: its length, the guard at its end or -1, whether it reaches the end of the run. */
typedef struct { double dt; int row, last; } Piece;

/* Whether the expansion at the end of an instant is that of the motion that follows. */
static int is_expanded(Run *r) {
  const Expansion *e = &r->e;
  int same = r->expanded && e->stamp == r->stamp && !memcmp(e->l.letter, r->letter, r->width);
  r->expanded = 0;
  for (int i = 0; same && i < r->n; i++) same = e->states[(int64_t)i * r->stride] == r->x[i];
  for (int j = 0; same && j < e->l.slides; j++)
    same = e->series[(int64_t)e->l.sliding[j] * r->stride] == r->unknowns[e->l.sliding[j]];
  return same;
}

/* Plan a Taylor step; 0 where the run has ended. */
static int taylor_piece(Run *r, double left, Piece *q) {
  Expansion *e = &r->e;
  double dt = 0;
  if (!is_expanded(r)) expand(r, r->letter, r->x, r->unknowns, e);
  if (!e->finite) { leave_singular(r, e, left); return 0; }
  double by_series = step_size(r, e), far = e->l.bent_count ? leave_out_far(r, e, left, by_series) : 0;
  if (far > 0) by_series = smaller(step_size(r, e), far);
  double h = smaller(by_series, r->o.max_step);
  if (h <= SHORTEST * time_scale(r) && h < left) {
    if (!ends_at_singular(r)) finish(r, STEP_TOO_SMALL, r->shortened > SHORTENED / 10 ? BRANCH_POINT : NO_REASON, 0);
    return 0;
  }
  if (r->over) h = smaller(h, OVER * SHORTEST * time_scale(r)); /* step over a guard whose event changed nothing */
  r->over = 0;
  if (is_fold_ahead(r, e, by_series)) {
    int fold = reach_fold(r, e, left);
    if (fold >= 0) serve_between(r, fold);
    if (fold >= 0 || r->status != RUNNING) return 0;
  }
  int last = h >= left;
  if (last) h = left;
  /* Events at the end of the run, to rounding, are included. */
  double after = AT_END * (time_scale(r) + h);
  int row = first_hit(r, e, last ? h + after : h, &dt);
  dt = row >= 0 ? smaller(dt, h) : last ? h : to_number(r, h);
  if (row >= 0 && is_before_fold(r, e, row, dt)) { dt = to_number(r, 0.5 * dt); row = -1; last = 0; }
  if (r->hold < dt) { dt = r->hold; row = -1; last = 0; } else r->hold = INFINITY;
  double requested = dt, safe = safe_length(r, e, by_series), good;
  while (dt > 0 && (good = verified(r, e, dt, row >= 0 && dt == requested ? BEFORE_EVENT : JUST, safe)) < dt) dt = good;
  int grows = r->mode == r->length_mode && dt > r->length / STEADY;
  int shrinks = dt <= requested / FAR && !grows;
  r->shortened = larger(0, r->shortened + (shrinks ? 1 : -0.2));
  r->length_mode = r->mode;
  r->length = dt == requested ? h : dt;
  int swallowed = dt < requested && dt <= SHORTEST * time_scale(r); /* close to t = 0 steps may be tiny */
  if (r->shortened >= SHORTENED || swallowed) {
    if (!(r->has_roots && ends_at_singular(r))) finish(r, STEP_TOO_SMALL, BRANCH_POINT, 0);
    return 0;
  }
  if (dt < requested) row = -1, last = 0;
  if (row < 0) watch_decay(r, e, by_series);
  if (r->wants_program) return 0;
  *q = (Piece){dt, row, last && dt == h};
  return 1;
}

/* An implicit step; 0 where none could be made. */
static int implicit_piece(Run *r, double left, Piece *q) {
  Expansion *e = &r->e;
  double h = implicit_step(r, e, smaller(left, r->o.max_step)), dt = 0;
  watch_cost(r, h);
  if (h == 0) return 0;
  int last = h == left, row = first_hit(r, e, last ? h + AT_END * (time_scale(r) + h) : h, &dt);
  dt = row >= 0 ? smaller(dt, h) : h;
  if (r->hold < dt) { dt = r->hold; row = -1; } else r->hold = INFINITY;
  if (dt == 0) e->end = 0; /* the state is that of the start */
  if (dt < h && dt > 0 && !end_at(r, e, row, &dt)) { r->implicit->c.h = 0.5 * dt; return 0; }
  r->length_mode = -1;
  *q = (Piece){dt, row, last && dt == h};
  return 1;
}

static void step(Run *r) {
  if (r->instant.running) { instant_next(r); return; }
  if (r->due_impact >= 0) { serve_between(r, r->due_impact); return; }
  double left = r->o.t_end - r->t - r->t_low;
  if (left <= 0) { finish(r, REACHED_END, NO_REASON, 0); return; }
  if (r->step_count >= r->o.max_steps) { finish(r, TOO_MANY_STEPS, r->held_steps >= HELD_STEPS ? DECAY : NO_REASON, 0); return; }
  if (r->has_roots && pass_root(r, left)) return;
  Expansion *e = &r->e;
  Piece q;
  int is_stiff = !r->over && is_implicit(r);
  if (r->wants_program) return;
  if (!(is_stiff && implicit_piece(r, left, &q)) && !taylor_piece(r, left, &q)) return;
  if (q.row < 0) memset(r->instant.passing, 0, r->s->rules.atoms);
  if (q.dt > 0) note_sides(r, e, q.dt);
  r->falls = q.row >= 0 && is_steep(r, e, q.row, q.dt);
  if (q.row >= 0 && r->now.kind[q.row] != IMPACT_GUARD) note_hidden(r, e, q.row); /* slow impacts accumulate */
  if (!advance(r, e, q.dt)) return;
  if (q.last) {
    r->t = r->o.t_end;
    r->t_low = 0;
    set_time_state(r);
    if (r->o.dense) r->out.point_t[r->out.points - 1] = r->t;
  }
  if (q.row >= 0 && is_atom(r->now.kind[q.row])) arrive(r, e, q.dt, r->instant.tied);
  else if (q.row >= 0) {
    int64_t events = r->event_count;
    serve_between(r, q.row);
    if (r->event_count == events && q.dt <= SHORTEST * time_scale(r)) { /* no progress */
      r->shortened++;
      int is_exit = r->now.kind[q.row] == EXIT_GUARD && has_law(r, r->now.index[q.row], SURFACE_LAW);
      r->over = r->status == RUNNING && is_exit;
      if (r->over) r->drop[q.row] = r->order + 1;
    }
  }
  else if (!q.last) {
    if (r->s->sets) check_sets(r);
    watch_two_fold(r);
  }
}

/* The last mode counts only if it lasted for a step (or is the only one). */
static int32_t final_itinerary(const Run *r) {
  int32_t above = r->table->tree.node[r->itinerary].parent;
  return r->segment_steps == 0 && above > 0 ? above : r->itinerary;
}
