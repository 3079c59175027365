/* Events at one instant, one jump after another ---------------------------------------------------------
 *
 * Conditions of events are trees over sides of atoms: the guards of stops and resets and the further functions of
 * relations. A side changes only where the motion passes the atom's zero, where a jump leads clearly to the other side,
 * and where the motion leaves the zero at the end of an instant. ``view`` has the sides after the jumps so far. The law
 * is the contract of events, sections 3 and 4.
 */
enum { LEVEL = 1, BY_JUMPS = 2, PERSISTENT = 4, AT_TRIGGER = 8 };

static int is_true(const int32_t *code, int count, const int8_t *side) {
  int8_t stack[MOST_CODES];
  int top = 0;
  for (int i = 0; i < count; i++) {
    if (code[i] >= 0) { stack[top++] = code[i] % 8 >> (side[code[i] / 8] + 1) & 1; continue; }
    top--;
    stack[top - 1] = code[i] == -1 ? stack[top - 1] & stack[top] : stack[top - 1] | stack[top];
  }
  return stack[0];
}

static int triggers(const Run *r, int k, const int8_t *side) {
  const Rules *u = &r->s->rules;
  return is_true(u->condition + u->trigger_at[k], u->trigger_at[k + 1] - u->trigger_at[k], side);
}

static int passes_filter(const Run *r, int event, const int8_t *side) {
  const Rules *u = &r->s->rules;
  return is_true(u->filter + u->filter_at[event], u->filter_at[event + 1] - u->filter_at[event], side);
}

/* Values of the atoms at a state, and which of them are zero to rounding. An atom stays zero unless a jump moves it by more
 * than the error of its root. */
static void evaluate_atoms(Run *r, const double *x) {
  const System *s = r->s;
  Instant *i = &r->instant;
  double *weight = r->vector;
  values_at(&s->atoms, x, r->p, r->atom_work);
  weigh_state(r, x, weight);
  gradient_sums(r, &s->atoms, r->atom_work, s->rules.atoms, &s->atom_gradient, s->rules.atoms, weight, 1, i->noise);
  for (int a = 0; a < s->rules.atoms; a++) {
    i->value[a] = out_of(&s->atoms, r->atom_work, a);
    i->zero[a] = fabs(i->value[a]) <= ON_GUARD * i->noise[a] + 2 * i->residual[a];
  }
}

static int sign_of(double value) { return (value > 0) - (value < 0); }

static void pend(Run *r, int k) {
  Instant *i = &r->instant;
  i->pending[k] = 1;
  if (r->s->rules.keeps) memcpy(i->trigger_x + (int64_t)k * r->n, r->x, sizeof(double) * r->n);
}

/* Store the truth values of the conditions before a change of sides. */
static void keep_truths(Run *r) {
  Instant *i = &r->instant;
  for (int k = 0; k < r->s->rules.triggers; k++) i->was[k] = triggers(r, k, i->side) || triggers(r, k, i->view);
}

/* Mark conditions that have become true since as pending, except those of the event that jumped. */
static void pend_new(Run *r, int jumped) {
  const Rules *u = &r->s->rules;
  for (int k = 0; k < u->triggers; k++) {
    int event = u->trigger_event[k];
    if (!r->instant.was[k] && event != jumped && u->flags[event] & BY_JUMPS && triggers(r, k, r->instant.view)) pend(r, k);
  }
}

static int is_filtered(Run *r, int event) {
  const Rules *u = &r->s->rules;
  if (u->filter_at[event] < u->filter_at[event + 1]) return passes_filter(r, event, r->instant.now);
  return out_of(&r->s->choices, r->choice_work, event) != 0;
}

/* Whether a level event is due: its condition and filter are true in view. One with an atom at zero waits for the motion
 * that follows, except before the first jump. */
static int is_level_due(const Run *r, int event) {
  const Rules *u = &r->s->rules;
  const Instant *i = &r->instant;
  const int32_t *code = u->filter + u->filter_at[event];
  int found = 0, filters = u->filter_at[event + 1] - u->filter_at[event];
  for (int k = 0; k < u->triggers; k++) if (u->trigger_event[k] == event) found |= triggers(r, k, i->view);
  if (!found || (filters && !passes_filter(r, event, i->view))) return 0;
  if (i->first || i->settled) return 1;
  for (int q = 0; q < filters; q++) if (code[q] >= 0 && i->zero[code[q] / 8]) return 0;
  for (int k = 0; k < u->triggers; k++)
    for (int q = u->trigger_at[k]; u->trigger_event[k] == event && q < u->trigger_at[k + 1]; q++)
      if (u->condition[q] >= 0 && i->zero[u->condition[q] / 8]) return 0;
  return 1;
}

/* The next due event, or -1: stops, then resets by priority, then in their order. */
static int next_event(Run *r) {
  const Rules *u = &r->s->rules;
  Instant *i = &r->instant;
  int best = -1, events = r->s->stops + r->s->resets;
  double most = 0;
  for (int k = 0; k < u->triggers; k++)
    if (i->pending[k] && !(u->flags[u->trigger_event[k]] & PERSISTENT) && !triggers(r, k, i->view)) i->pending[k] = 0;
  for (int a = 0; a < u->atoms; a++) i->now[a] = i->zero[a] ? 0 : sign_of(i->value[a]);
  values_at(&r->s->choices, r->x, r->p, r->choice_work);
  for (int event = 0; event < events; event++) {
    int pending = 0;
    for (int k = 0; k < u->triggers; k++) pending |= u->trigger_event[k] == event && i->pending[k];
    int due = (pending && is_filtered(r, event)) || (u->flags[event] & LEVEL && is_level_due(r, event));
    if (!due) continue;
    if (event < r->s->stops) return event;
    double priority = out_of(&r->s->choices, r->choice_work, events + event);
    if (best < 0 || priority > most) { best = event; most = priority; }
  }
  return best;
}

/* The state after a reset, at the same time. */
static void reset_map(Run *r, int index, const double *x, double *after) {
  int nd = r->s->dimension;
  values_at(&r->s->maps, x, r->p, r->maps);
  for (int i = 0; i < nd; i++) after[i] = out_of(&r->s->maps, r->maps, index * nd + i);
  if (r->s->timed) after[nd] = x[nd];
}

/* Count the ticks of a clock from its next one, whose time is two numbers. */
static void count_ticks(Run *r, int c) {
  double period = out_of(&r->s->choices, r->choice_work, 2 * (r->s->stops + r->s->resets) + c);
  Pair left = pair_sum((Pair){period, 0}, (Pair){-r->x[r->s->rules.clock_state[c]], 0});
  Pair next = pair_sum((Pair){r->t, r->t_low}, left);
  r->instant.tick[2 * c] = next.high;
  r->instant.tick[2 * c + 1] = next.low;
  r->instant.count[c] = 0;
}

/* Count the ticks of clocks after a jump, from zero where the jump moved the phase. */
static void set_clocks(Run *r, int event, const double *before) {
  const Rules *u = &r->s->rules;
  Instant *i = &r->instant;
  for (int c = 0; c < u->clocks; c++) {
    int at = u->clock_state[c], own = event == r->s->stops + u->clock_reset[c];
    if (own && r->x[at] == 0) i->count[c]++;
    else if (own || r->x[at] != before[at]) count_ticks(r, c);
  }
}

/* Whether discrete states have values of their lists, if they have one. */
static int has_values(const Run *r) {
  const Rules *u = &r->s->rules;
  for (int d = 0; d < u->discrete; d++) {
    int known = u->value_at[d] == u->value_at[d + 1];
    for (int q = u->value_at[d]; q < u->value_at[d + 1]; q++)
      known |= r->x[r->s->dimension - u->discrete + d] == u->value[q];
    if (!known) return 0;
  }
  return 1;
}

/* The state and the sides after a jump. */
static void after_jump(Run *r, int event) {
  Instant *i = &r->instant;
  evaluate_atoms(r, r->x);
  for (int a = 0; a < r->s->rules.atoms; a++) {
    if (i->zero[a]) continue; /* both sides are kept until the motion decides */
    i->side[a] = i->view[a] = (int8_t)sign_of(i->value[a]);
    i->passing[a] = 0;
    i->residual[a] = 0;
  }
  pend_new(r, event);
  i->first = i->settled = 0;
}

/* Begin an instant: ``tied`` is a guard of the mode that is due at its end, or -1. */
static void begin_instant(Run *r, int tied) {
  Instant *i = &r->instant;
  i->running = i->first = 1;
  i->settled = i->unsettled = i->jumps = 0;
  i->last = -1;
  i->sampled = 0;
  i->is_last = 0;
  i->counted = r->event_count;
  i->tied = tied;
  memcpy(i->arrived, r->x, sizeof(double) * r->n);
}

/* Write the data of a restart besides the state, also within an instant. */
static void write_motion(const Run *r, double *to) {
  const Rules *u = &r->s->rules;
  const Instant *i = &r->instant;
  const int8_t *sides[] = {i->side, i->view, i->passing};
  double head[] = {i->running, i->first, i->last, (double)i->jumps, i->settled};
  *to++ = r->t_low;
  if (!u->atoms) return;
  for (int k = 0; k < 5; k++) *to++ = head[k];
  for (int k = 0; k < 3; k++) for (int a = 0; a < u->atoms; a++) *to++ = sides[k][a];
  for (int a = 0; a < u->atoms; a++) *to++ = i->residual[a];
  for (int k = 0; k < u->triggers; k++) *to++ = i->pending[k];
  for (int c = 0; c < u->clocks; c++) { *to++ = i->tick[2 * c]; *to++ = i->tick[2 * c + 1]; *to++ = (double)i->count[c]; }
  if (u->keeps) memcpy(to, i->trigger_x, sizeof(double) * u->triggers * r->n);
}

static void read_motion(Run *r, const double *from) {
  const Rules *u = &r->s->rules;
  Instant *i = &r->instant;
  int8_t *sides[] = {i->side, i->view, i->passing};
  from++; /* of the time, read before */
  begin_instant(r, -1);
  i->running = (int)from[0];
  i->first = (int)from[1];
  i->last = i->running ? (int)from[2] : -1;
  i->jumps = i->running ? (int64_t)from[3] : 0;
  i->settled = (int)from[4];
  from += 5;
  for (int k = 0; k < 3; k++) for (int a = 0; a < u->atoms; a++) sides[k][a] = (int8_t)*from++;
  for (int a = 0; a < u->atoms; a++) i->residual[a] = *from++;
  for (int k = 0; k < u->triggers; k++) i->pending[k] = (int8_t)*from++;
  for (int c = 0; c < u->clocks; c++) {
    i->tick[2 * c] = *from++;
    i->tick[2 * c + 1] = *from++;
    i->count[c] = (int64_t)*from++;
  }
  if (u->keeps) memcpy(i->trigger_x, from, sizeof(double) * u->triggers * r->n);
  for (int k = 0; u->keeps && r->s->timed && k < u->triggers; k++) i->trigger_x[(k + 1) * r->n - 1] = 0; /* this time */
}

/* Process an event: one jump, or the end of the run. */
static void serve_event(Run *r, int served) {
  const Rules *u = &r->s->rules;
  Instant *i = &r->instant;
  int index = served - r->s->stops, row = r->now.atoms + served, nd = r->s->dimension, kept = -1;
  double *x = r->before;
  for (int k = u->triggers - 1; k >= 0; k--)
    if (u->trigger_event[k] == served) {
      if (i->pending[k]) kept = k;
      i->pending[k] = i->unfired[k] = 0;
    }
  r->guard = (Guard){r->now.kind[row], r->now.index[row], r->now.side[row]};
  i->last = served;
  if (served < r->s->stops) {
    event(r, STOP, r->mode, row, r->x);
    if (!r->o.passed || !r->o.passed[served]) finish(r, STOPPED, NO_REASON, served);
    return;
  }
  memcpy(x, r->x, sizeof(double) * r->n);
  if (u->flags[served] & AT_TRIGGER && kept >= 0) {
    reset_map(r, index, i->trigger_x + (int64_t)kept * r->n, r->at_work);
    for (int k = 0; k < nd; k++) if (u->named[index * nd + k]) r->x[k] = r->at_work[k];
  } else reset_map(r, index, x, r->x);
  if (!finite_all(r->x, nd)) {
    memcpy(r->x, x, sizeof(double) * r->n);
    finish(r, NOT_FINITE, RESET_MAP, index);
    event(r, RESET, r->mode, row, x);
    return;
  }
  note(r);
  set_clocks(r, served, x);
  keep_truths(r);
  after_jump(r, served);
  i->unsettled = 1;
  i->jumps++;
  if (!has_values(r)) finish(r, INCONSISTENT, DISCRETE_VALUE, index);
  event(r, RESET, r->mode, row, x);
}

/* Whether an event's own map leaves the motion directed into its zero: a reset has no contact force. */
static int is_pressed(Run *r, int atom, int zeros, int sign) {
  const Rules *u = &r->s->rules;
  int event = r->instant.last, before = r->instant.side[atom];
  if (event < r->s->stops || zeros != 2 || before * sign > 0) return 0;
  for (int k = 0; k < u->triggers; k++)
    if (u->trigger_event[k] == event && u->trigger_at[k + 1] - u->trigger_at[k] == 1
        && u->condition[u->trigger_at[k]] / 8 == atom && u->condition[u->trigger_at[k]] % 8 >> (sign + 1) & 1)
      return !(u->flags[event] & LEVEL) || is_filtered(r, event);
  return 0;
}

/* Coefficients of an atom's polynomial at the time of an arrival, beyond the zero. */
static void keep_germ(const Run *r, const double *g, double dt, double *germ) {
  double c[P + 1];
  memcpy(c, g, sizeof(double) * (r->order + 1));
  move_origin(c, r->order, dt, r->order < GERM + 1 ? r->order : GERM + 1);
  memcpy(germ, c + 1, sizeof(double) * GERM);
}

/* Whether an atom that passed zero continues as it arrived: rounding at a multiple zero is then no reversal. */
static int goes_on(const Run *r, int atom) {
  const double *germ = r->instant.germ + GERM * atom;
  const double *g = r->e.guards + (int64_t)(r->now.atoms + atom) * r->stride;
  if (!r->instant.passing[atom]) return 0;
  for (int k = 0; k < GERM; k++)
    if (!(fabs(g[k + 1] - germ[k]) <= RESOLVED * RESOLVED * (fabs(g[k + 1]) + fabs(germ[k])) + ON_SURFACE * r->instant.noise[atom]))
      return 0;
  return 1;
}

/* Set sides of the atoms at zero by the first nonzero coefficient of the motion that follows. */
static void leave_zeros(Run *r) {
  Instant *i = &r->instant;
  int any = 0, atoms = r->s->rules.atoms;
  for (int a = 0; a < atoms; a++) any |= i->zero[a];
  if (!any) return;
  expand(r, r->letter, r->x, r->unknowns, &r->e);
  r->expanded = !r->s->sets && !r->s->tables && !r->s->combined;
  if (!r->e.finite) return;
  for (int a = 0; a < atoms; a++) {
    double value;
    int row = r->now.atoms + a;
    r->drop[row] = 0;
    if (!i->zero[a]) continue;
    r->drop[row] = leading(r, &r->e, row, 1, &value);
    if (r->drop[row] > 1 && goes_on(r, a)) { value = -i->side[a]; r->drop[row] = 1; }
    if (i->jumps && is_pressed(r, a, r->drop[row], sign_of(value))) {
      r->limit = r->t;
      finish(r, ACCUMULATION, PRESSED, i->last - r->s->stops);
    }
    i->side[a] = i->view[a] = (int8_t)sign_of(value);
    i->passing[a] = 0;
    i->residual[a] = 0;
  }
}

/* Set the mode of an instant's events and samples after the last event. */
static void end_instant(Run *r) {
  Instant *i = &r->instant;
  i->running = 0;
  if (r->s->rules.discrete && i->jumps && !r->s->sets) {
    r->shown = shown_number(r, r->letter);
    enter_segment(r, r->shown);
  }
  memset(i->pending, 0, r->s->rules.triggers);
  memset(i->passing, 0, r->s->rules.atoms);
  if (r->o.dense && i->jumps) {
    int64_t k = r->out.events - 1;
    r->out.event_after[k] = r->mode;
    memcpy(r->out.event_after_x + k * r->n, r->x, sizeof(double) * r->n);
    if (r->out.event_motion) write_motion(r, r->out.event_motion + k * r->s->rules.width);
  }
  if (i->sampled) /* the state after all jumps */
    memcpy(r->sample_x + (i->sampled - 1) * r->s->dimension, r->x, r->s->dimension * sizeof(double));
  if (i->is_last) finish(r, STOPPED, SAMPLED, (int)r->o.hit_count);
  if (r->event_count == i->counted) return;
  int before = r->mode;
  see_limit(r);
  if (r->mode != before && r->status == RUNNING) { evaluate_atoms(r, r->x); leave_zeros(r); }
  if (r->event_count >= r->o.max_events) finish(r, TOO_MANY_EVENTS, NO_REASON, 0);
}

/* Finish an instant without due events: the tied guard, the mode, and the sides of the motion that follows. */
static void settle_instant(Run *r) {
  Instant *i = &r->instant;
  int row = i->tied, kind = row < 0 ? -1 : r->now.kind[row], jumped = i->unsettled;
  i->tied = -1;
  if (kind == IMPACT_GUARD) {
    const double *gap = gaps(r, r->x);
    int j = r->now.index[row] - r->m;
    if (jumped && !(fabs(gap[j]) <= r->o.atol && gap[r->c + j] < 0)) row = -1;
  } else if (jumped) row = -1;
  if (row >= 0) {
    keep_truths(r);
    serve(r, row);
    i->unsettled = 0;
    if (r->status == RUNNING) after_jump(r, -1);
    return;
  }
  if (jumped) keep_truths(r);
  jumped = jumped && settle_in(r);
  i->unsettled = 0;
  if (r->status != RUNNING) return;
  if (jumped) { after_jump(r, -1); return; }
  keep_truths(r);
  leave_zeros(r);
  if (r->status != RUNNING) return;
  pend_new(r, i->last);
  i->settled = 1;
  if (next_event(r) < 0) end_instant(r);
}

/* One jump, or the end of the instant. */
static void instant_next(Run *r) {
  Instant *i = &r->instant;
  int event = next_event(r);
  if (event < 0) { settle_instant(r); return; }
  if (r->event_count >= r->o.max_events) { finish(r, TOO_MANY_EVENTS, NO_REASON, 0); return; }
  if (i->jumps >= r->o.max_jumps) { finish(r, ENDLESS_JUMPS, NO_REASON, 0); return; }
  serve_event(r, event);
}

/* Pass atoms at the end of a step, also those that were not located because no event depends on them. */
static void arrive(Run *r, const Expansion *e, double dt, int tied) {
  const Rules *u = &r->s->rules;
  Instant *i = &r->instant;
  begin_instant(r, tied);
  for (int c = 0; c < u->clocks; c++) /* a tick is exact */
    if (i->passing[r->s->stops + u->clock_reset[c]]) {
      r->t = tick_of(r, c, &r->t_low);
      r->x[u->clock_state[c]] = out_of(&r->s->choices, r->choice_work, 2 * (r->s->stops + r->s->resets) + c);
      set_time_state(r);
      if (r->o.dense) r->out.point_t[r->out.points - 1] = r->t;
      renote(r);
    }
  evaluate_atoms(r, r->x);
  for (int a = 0; a < u->atoms; a++) {
    double slope;
    if (i->zero[a] && !i->passing[a] && i->side[a] && u->way[a] != UNWATCHED) {
      horner(e->guards + (int64_t)(e->l.atoms + a) * r->stride, r->order, dt, &slope);
      i->passing[a] = slope * i->side[a] < 0;
    }
    else if (i->passing[a] && u->way[a]) i->side[a] = (int8_t)-u->way[a]; /* it may have turned within the step */
    if (i->passing[a]) keep_germ(r, e->guards + (int64_t)(e->l.atoms + a) * r->stride, dt, i->germ + GERM * a);
    if (i->passing[a]) { i->residual[a] = fabs(i->value[a]); i->zero[a] = 1; }
    i->view[a] = (int8_t)(i->passing[a] ? -i->side[a] : i->side[a]);
    if (u->way[a] == UNWATCHED && !i->zero[a]) i->side[a] = i->view[a] = (int8_t)sign_of(i->value[a]);
  }
  for (int k = 0; k < u->triggers; k++) if (!triggers(r, k, i->side) && triggers(r, k, i->view)) pend(r, k);
}

/* Process a guard of the mode; it may be a jump, and the motion may leave the zeros of atoms. */
static void serve_between(Run *r, int row) {
  if (!r->s->rules.atoms) { serve(r, row); return; }
  begin_instant(r, -1);
  memcpy(r->instant.view, r->instant.side, r->s->rules.atoms);
  keep_truths(r);
  serve(r, row);
  if (r->status == RUNNING) after_jump(r, -1);
}

/* Whether a reset without a direction would reverse the motion at a start on its zero. */
static int turns_round(Run *r, int event, int zeros, double value) {
  double *after = r->at_work, back;
  int row = r->now.atoms + event;
  reset_map(r, event - r->s->stops, r->x, after);
  expand(r, r->letter, after, r->unknowns, &r->trial);
  int again = leading(r, &r->trial, row, 0, &back);
  return again > 0 && (back * value <= 0 || (again < zeros ? again : zeros) > 1);
}

/* Find the events that are due at the start: resets on whose zero the motion enters, level events, events with
 * ``initially``. */
static void begin_events(Run *r, const double *motion) {
  const Rules *u = &r->s->rules;
  Instant *i = &r->instant;
  if (!u->atoms || r->status != RUNNING) return;
  values_at(&r->s->choices, r->x, r->p, r->choice_work);
  memset(i->residual, 0, sizeof(double) * u->atoms);
  memset(i->pending, 0, u->triggers);
  memset(i->passing, 0, u->atoms);
  for (int c = 0; c < u->clocks; c++) count_ticks(r, c);
  evaluate_atoms(r, r->x);
  if (motion) {
    read_motion(r, motion);
    if (i->running) { i->unsettled |= !i->settled; return; }
    for (int a = 0; a < u->atoms; a++) i->zero[a] |= i->side[a] != sign_of(i->value[a]) && u->way[a] != UNWATCHED;
    memcpy(i->now, i->side, u->atoms);
    leave_zeros(r);
    memcpy(i->side, i->now, u->atoms);
    memcpy(i->view, i->now, u->atoms);
    return;
  }
  begin_instant(r, -1);
  for (int a = 0; a < u->atoms; a++) i->side[a] = i->view[a] = (int8_t)(i->zero[a] ? 0 : sign_of(i->value[a]));
  leave_zeros(r);
  for (int a = 0; a < u->atoms; a++) i->now[a] = (int8_t)(i->zero[a] ? -i->side[a] : i->side[a]);
  for (int k = 0; k < u->triggers; k++) {
    int event = u->trigger_event[k], two = (k && u->trigger_event[k - 1] == event)
                                           || (k + 1 < u->triggers && u->trigger_event[k + 1] == event);
    int arrived = triggers(r, k, i->side) && !triggers(r, k, i->now), initial = u->initially[event];
    if (initial > 0 ? triggers(r, k, i->side) : initial < 0 && event >= r->s->stops && arrived && !two) pend(r, k);
    i->unfired[k] = initial < 0 && !two && !(u->flags[event] & LEVEL) && !i->pending[k] && triggers(r, k, i->side);
    if (two && initial < 0 && event >= r->s->stops && arrived && i->zero[event]
        && turns_round(r, event, r->drop[r->now.atoms + event], i->side[event]))
      finish(r, NON_UNIQUE, TWO_SIDED, event - r->s->stops);
  }
  i->settled = 1;
  if (r->status == RUNNING && next_event(r) < 0) i->running = 0;
  for (int a = 0; i->running && a < u->atoms; a++) /* the motion arrives from the other side */
    if (i->zero[a]) i->side[a] = (int8_t)-i->view[a];
}
