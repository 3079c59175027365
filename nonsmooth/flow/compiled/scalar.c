/* The reference driver in C: one trajectory, any number of surfaces, every kind of event.
 *
 * The functions have the names and the order of nonsmooth/flow/{driver,stepper,switching}.py; read
 * those first. What is rare and slow anyway (points where the jet is not finite, branch points of the
 * field) is handed over to them.
 *
 * The generated text defines, besides what common.h asks for: MODES, LETTER[MODES][M] (+1, -1, 0),
 * MODE_OF[3^M], CANCELLED[MODES], AFFINE[MODES], GUARDS[MODES], GUARD[MODES][NG] = {kind, index, side},
 * jet(mode, x, q, c, g), values(mode, x, q, f, g), guard_values(mode, x, q, value, gradient), surface_values(x, q, h,
 * gradient), reset_map(index, x, q, y), prepare(p, q).
 */
#define HISTORY 48

typedef struct { double states[N][P + 1], guards[NG1][P + 1], gradient[NG1][N], scale[NG1];
                 int mode, finite; } Expansion;

/* What a run writes, when dense: steps, points and events, emptied by the caller when full. */
typedef struct {
  int64_t steps, points, events, step_room, point_room, event_room;
  double *start, *coefficients, *point_t, *point_x, *event_t, *event_x, *event_after_x;
  int32_t *step_mode, *event_kind, *event_before, *event_after, *event_guard;
} Output;

typedef struct {
  Options o;
  double x[N], q[NQ], t, begun, last_event, limit, at_t, at_x[N];
  int32_t mode, status, reason, where, due, drop[NG1];
  int32_t side[2][NG1]; /* of stops and resets just before, where it is clear */
  int32_t fired[NG1]; /* resets since the motion last moved */
  int64_t step_count, event_count, kinds[KINDS], segment_steps;
  int32_t itinerary, segment_mode;
  double interval[HISTORY];
  int32_t pattern[HISTORY];
  int64_t history;
  double size; /* of states at which both tolerances are as large */
  double length, shortened; /* of the step before */
  int32_t length_mode;
  Output out;
  int64_t hits, kept, room; /* of the section; samples kept, in row of the results */
  const double *times;
  double *sample_t, *sample_x;
  Tree *tree;
} Run;

static void finish(Run *r, int status, int reason, int where) {
  if (r->status == RUNNING) { r->status = status; r->reason = reason; r->where = where; }
}

/* Numbers: nonsmooth/flow/reference/stepper.py ------------------------------------------------------- */

/* Rounding in a guard is that times epsilon; infinite slopes, those of a square root at zero, say
 * nothing and are left out. */
static double rounding_scale(const Run *r, const double *gradient) {
  double scale = 0;
  for (int i = 0; i < N; i++) {
    double slope = fabs(gradient[i]);
    scale += slope < INFINITY ? slope * (r->size + fabs(r->x[i])) : 0;
  }
  return scale;
}

static void expand(const Run *r, int mode, Expansion *e) {
  double value[NG1];
  e->mode = mode;
  jet(mode, r->x, r->q, &e->states[0][0], &e->guards[0][0]);
  guard_values(mode, r->x, r->q, value, &e->gradient[0][0]);
  /* A coefficient that is not finite makes all later ones so, or is the first: the field, which is not
   * used again where a logarithm's argument is negative. */
  double zero = 0, none = 0;
  for (int i = 0; i < N; i++) {
    zero += 0 * e->states[i][P];
    none += 0 * e->states[i][P - 1] + 0 * e->states[i][1];
  }
  for (int j = 0; j < GUARDS[mode]; j++) {
    zero += 0 * e->guards[j][P];
    none += 0 * e->guards[j][P - 1] + 0 * e->guards[j][0];
  }
  e->finite = zero + none == 0;
  for (int j = 0; j < GUARDS[mode]; j++) {
    for (int i = 0; i < N; i++) e->gradient[j][i] = fabs(e->gradient[j][i]);
    e->scale[j] = rounding_scale(r, e->gradient[j]);
  }
}

/* Binary logarithm and exponential to 1e-4: enough for a step size, a hundredth of libm's cost. */
static inline double rough_log2(double a) {
  union { double d; int64_t i; } u = {a};
  double e = (double)((u.i >> 52) - 1023);
  u.i = (u.i & 0xfffffffffffffLL) | 0x3ff0000000000000LL;
  double m = u.d - 1.5;
  return e + 0.5849625007 + m * (0.9617966939 + m * (-0.3205988980 + m * (0.1424883991
         + m * (-0.0712441996 + m * (0.0379969064 - m * 0.0211093925)))));
}
static inline double rough_exp2(double a) {
  double k = (a + 6755399441055744.0) - 6755399441055744.0, f = (a - k) * 0.6931471805599453;
  union { double d; int64_t i; } u;
  u.i = ((int64_t)k + 1023) << 52;
  return u.d * (1 + f * (1 + f * (0.5 + f * (0.16666666666 + f * (0.0416666666 + f * 0.0083333333)))));
}
static double step_for(double last, double before) {
  double log_h = INFINITY;
  if (last > 0) log_h = rough_log2(smaller(last, 1e300)) * (-1.0 / P);
  if (before > 0) log_h = smaller(rough_log2(smaller(before, 1e300)) * (-1.0 / (P - 1)), log_h);
  return log_h < INFINITY ? rough_exp2(log_h) : INFINITY;
}

/* Shorten a step until a guard's series converges within it. */
static double resolve(const double *g, double h) {
  while (h < INFINITY) {
    double power = 1;
    for (int k = 1; k < P; k++) power *= h;
    double last = larger(fabs(g[P]) * h, fabs(g[P - 1])) * power;
    double rest = RESOLVED * (fabs(g[0]) + rest_of(g, P - 2, h));
    if (last <= rest || !(rest > 0 && rest < INFINITY)) break;
    h *= 0.99 * pow(rest / last, 1.0 / (P - 1));
  }
  return h;
}

static double step_size(const Run *r, const Expansion *e) {
  double allowed[N] = {0}, last = 1e-300, before = 1e-300;
  int small[NG1];
  for (int i = 0; i < ND; i++) {
    allowed[i] = SAFETY * (r->o.atol + r->o.rtol * fabs(e->states[i][0]));
    last = larger(fabs(e->states[i][P]) / allowed[i], last);
    before = larger(fabs(e->states[i][P - 1]) / allowed[i], before);
  }
  for (int j = 0; j < GUARDS[e->mode]; j++) {
    double a = r->o.rtol * fabs(e->guards[j][0]);
    for (int i = 0; i < ND; i++) a += e->gradient[j][i] * allowed[i];
    small[j] = !(a > 0 && a <= RESOLVED * fabs(e->guards[j][0]));
    if (a > 0) {
      last = larger(fabs(e->guards[j][P]) / a, last);
      before = larger(fabs(e->guards[j][P - 1]) / a, before);
    }
  }
  double h = step_for(last > 1e-300 ? last : 0, before > 1e-300 ? before : 0);
  for (int j = 0; j < GUARDS[e->mode]; j++) if (small[j]) h = resolve(e->guards[j], h);
  return h;
}

/* A length beyond which the step h that the series allows may not see what comes. */
static double safe_length(const Run *r, const Expansion *e, double h) {
  if (AFFINE[e->mode]) return INFINITY;
  if (e->mode == r->length_mode) return h > GROWTH * r->length ? r->length : INFINITY;
  double natural = INFINITY;
  for (int i = 0; i < N; i++)
    natural = smaller((fabs(e->states[i][0]) + r->size) / fabs(e->states[i][1]), natural);
  return h > FAR * natural ? FIRST * natural : INFINITY;
}

/* Whether field and guards at a time of the step are those of the polynomials. */
static int agrees(const Run *r, const Expansion *e, const double *allowed, const double *of_guards, double s,
                  double dt) {
  double x[N], slope[N], f[N], g[NG1], f_noise[N] = {0}, g_noise[NG1] = {0}, ignored;
  for (int i = 0; i < N; i++) x[i] = horner(e->states[i], P, s, &slope[i]);
  values(e->mode, x, r->q, f, g);
  for (int again = 0; again < 2; again++) {
    int near = 1;
    for (int i = 0; i < N; i++)
      near &= fabs(f[i] - slope[i]) * dt <= WRONG * allowed[i] + dt * (VANISHES * fabs(slope[i]) + f_noise[i]);
    for (int j = 0; j < GUARDS[e->mode]; j++) {
      double miss = fabs(g[j] - horner(e->guards[j], P, s, &ignored));
      near &= miss <= WRONG * of_guards[j] + VANISHES * e->scale[j] + g_noise[j];
    }
    if (near) return 1;
    /* What rounding in the states, and in the time, makes of it: far from zero more than a tolerance. */
    for (int k = 0; k < N && !again; k++) {
      double kept = x[k], moved[N], guards[NG1];
      x[k] += VANISHES * kept;
      values(e->mode, x, r->q, moved, guards);
      x[k] = kept;
      for (int i = 0; i < N; i++) f_noise[i] += fabs(moved[i] - f[i]);
      for (int j = 0; j < GUARDS[e->mode]; j++) g_noise[j] += fabs(guards[j] - g[j]);
    }
  }
  return 0;
}

/* dt where the polynomials agree at the part ``end`` of a step and at points inside, else half of the
 * first point where they do not. */
static double verified(const Run *r, const Expansion *e, double dt, double end, double safe) {
  double allowed[N], of_guards[NG1], low = isinf(safe) ? dt : 0.5 * dt;
  if (AFFINE[e->mode]) return dt;
  for (int i = 0; i < N; i++) allowed[i] = SAFETY * (r->o.atol + r->o.rtol * fabs(e->states[i][0]));
  for (int j = 0; j < GUARDS[e->mode]; j++) {
    of_guards[j] = SAFETY * r->o.rtol * fabs(e->guards[j][0]);
    for (int i = 0; i < N; i++) of_guards[j] += e->gradient[j][i] * allowed[i];
  }
  while (low > safe) low *= 0.5;
  for (; low < dt; low *= 2)
    for (int k = 0; k < OCTAVE; k++) {
      double s = low * (1 + (double)k / OCTAVE);
      if (!agrees(r, e, allowed, of_guards, s, dt)) return s > 2.2250738585072014e-308 ? 0.5 * s : 0;
    }
  for (int k = 1; k <= CHECKS; k++) {
    double s = dt * k / (CHECKS + 1);
    if (!agrees(r, e, allowed, of_guards, s, dt)) return s > 2.2250738585072014e-308 ? 0.5 * s : 0;
  }
  return agrees(r, e, allowed, of_guards, end * dt, dt) ? dt : dt > 2.2250738585072014e-308 ? 0.5 * dt : 0;
}

/* First coefficient of a guard that is not zero to rounding; P + 1 if there is none. */
static int leading(const Expansion *e, int row, int zeros, double *value) {
  double sum = 0;
  for (int i = 0; i < N; i++) sum += e->gradient[row][i];
  for (int k = zeros; k <= P; k++) {
    double noise = e->scale[row];
    if (k) {
      double speed = 0;
      for (int i = 0; i < N; i++) speed = larger(fabs(e->states[i][k]), speed);
      noise = sum * speed * (k + 1);
    }
    if (fabs(e->guards[row][k]) > VANISHES * noise) { *value = e->guards[row][k]; return k; }
  }
  *value = 0;
  return P + 1;
}

static double guard_root(const Expansion *e, int row, int drop, double h) {
  const int *guard = GUARD[e->mode][row];
  const double *c = e->guards[row] + drop;
  if (drop > P) return -1;
  if (guard[0] >= STOP_GUARD) return first_crossing(c, P - drop, h, guard[2]);
  if (c[0] <= 0) {
    double value;
    drop = leading(e, row, drop, &value);
    if (value == 0) return -1;
    c = e->guards[row] + drop;
  }
  return first_root(c, P - drop, h);
}

/* How far rounding in a guard moves its root; nothing where it has no slope. */
static double blur(const double *c, double dt) {
  double slope, noise = ROOT_ROUNDING * (fabs(c[0]) + rest_of(c, P, dt));
  horner(c, P, dt, &slope);
  slope = fabs(slope);
  return noise < 1e-9 * dt * slope ? noise / slope : 0;
}

/* A stop or a reset may be passed at the start of a step, where rounding hid it from the one before. */
static int passed_at_once(const Run *r, const Expansion *e, int row) {
  const int *guard = GUARD[e->mode][row];
  if (guard[0] < STOP_GUARD || r->drop[row]) return 0;
  int side = r->side[guard[0] == RESET_GUARD][guard[1]];
  return side && passed(e->guards[row], P, side, guard[2]);
}

static void note_sides(Run *r, const Expansion *e, double dt) {
  for (int j = 0; j < GUARDS[e->mode]; j++) {
    const int *guard = GUARD[e->mode][j];
    if (guard[0] < STOP_GUARD) continue;
    r->side[guard[0] == RESET_GUARD][guard[1]] =
        side_before(e->guards[j], P, dt, ON_SURFACE * e->scale[j]);
  }
}

/* Row of the earliest guard to end the mode within h, and the time; -1 if none. */
static int first_hit(const Run *r, const Expansion *e, double h, double *dt) {
  double time[NG1];
  int first = -1, found = 0;
  for (int j = 0; j < GUARDS[e->mode]; j++) {
    time[j] = passed_at_once(r, e, j) ? 0 : guard_root(e, j, r->drop[j], h);
    if (time[j] < 0) continue;
    found++;
    if (first < 0 || time[j] < time[first]) first = j;
  }
  int best = first;
  if (found > 1) {
    double near = time[first] + TIE * larger(fabs(r->t), 1) + blur(e->guards[first], time[first]);
    for (int j = 0; j < GUARDS[e->mode]; j++) {
      if (time[j] < 0 || time[j] > near + blur(e->guards[j], time[j])) continue;
      int rank = PRIORITY[GUARD[e->mode][j][0]], best_rank = PRIORITY[GUARD[e->mode][best][0]];
      if (rank < best_rank || (rank == best_rank && time[j] < time[best])) best = j;
    }
  }
  if (best >= 0) *dt = time[best];
  return best;
}

/* Surfaces --------------------------------------------------------------------------------- */

static int sliding_surface(int mode) {
  for (int i = 0; i < M; i++) if (LETTER[mode][i] == 0) return i;
  return -1;
}

static int mode_code(const int *letters) {
  int code = 0, weight = 1;
  for (int i = 0; i < M; i++) {
    code += weight * (letters[i] > 0 ? 0 : letters[i] < 0 ? 1 : 2);
    weight *= 3;
  }
  return MODE_OF[code];
}

/* Least-norm Newton steps of the states (not the time) onto the surfaces of a bit set: the rows are
 * made orthogonal one after the other (a dependent row drops out). */
static void project(Run *r, unsigned which) {
  for (int iteration = 0; which && iteration < 3; iteration++) {
    double h[M1], g[M1][N], row[M1][N], size[M1], residual[M1];
    int any = 0, k = 0;
    surface_values(r->x, r->q, h, &g[0][0]);
    for (int i = 0; i < M; i++) {
      if (!(which >> i & 1)) continue;
      any |= h[i] != 0;
      double full = 0;
      for (int l = 0; l < ND; l++) { row[k][l] = g[i][l]; full += g[i][l] * g[i][l]; }
      residual[k] = h[i];
      for (int j = 0; j < k; j++) {
        double s = 0;
        for (int l = 0; l < ND; l++) s += row[k][l] * row[j][l];
        s /= size[j];
        for (int l = 0; l < ND; l++) row[k][l] -= s * row[j][l];
        residual[k] -= s * residual[j];
      }
      size[k] = 0;
      for (int l = 0; l < ND; l++) size[k] += row[k][l] * row[k][l];
      if (size[k] > 1e-24 * full) k++;
    }
    if (!any) break;
    for (int j = 0; j < k; j++)
      for (int l = 0; l < ND; l++) r->x[l] -= residual[j] / size[j] * row[j][l];
  }
}

/* Whether Newton's steps have led onto a surface: not where its zero is a multiple one. */
static int is_on(const Run *r, int surface) {
  double h[M1], g[M1][N];
  surface_values(r->x, r->q, h, &g[0][0]);
  return fabs(h[surface]) <= VANISHES * rounding_scale(r, g[surface]);
}

/* Surfaces through the present state, to rounding, and those known to be. */
static unsigned active_surfaces(const Run *r, unsigned certain, int mode) {
  double h[M1], g[M1][N];
  if (M == 0) return 0;
  surface_values(r->x, r->q, h, &g[0][0]);
  for (int i = 0; i < M; i++) {
    if (fabs(h[i]) <= ON_SURFACE * rounding_scale(r, g[i])) certain |= 1u << i;
  }
  int s = sliding_surface(mode);
  return s >= 0 ? certain | 1u << s : certain;
}

/* Output ----------------------------------------------------------------------------------- */

static void note(Run *r) {
  if (!r->o.dense) return;
  int64_t k = r->out.points++;
  r->out.point_t[k] = r->t;
  memcpy(r->out.point_x + k * N, r->x, sizeof r->x);
}

static void renote(Run *r) {
  if (r->o.dense && r->out.points)
    memcpy(r->out.point_x + (r->out.points - 1) * N, r->x, sizeof r->x);
}

static void enter_segment(Run *r, int mode) {
  if (mode == r->segment_mode) return;
  if (r->segment_steps == 0) r->itinerary = r->tree->node[r->itinerary].parent;
  if (r->itinerary < 0) r->itinerary = 0;
  r->itinerary = tree_child(r->tree, r->itinerary, mode);
  r->segment_mode = mode;
  r->segment_steps = 0;
}

/* Samples: nonsmooth/flow/section.py */
static void sample(Run *r, double t, const double *x) {
  if (r->kept >= r->room) return;
  r->sample_t[r->kept] = t;
  memcpy(r->sample_x + r->kept++ * ND, x, ND * sizeof(double));
}

/* Samples at the times from the present one to less than that plus dt. */
static void sample_step(Run *r, const Expansion *e, double dt) {
  while (r->kept < r->room && r->times[r->kept] < r->t + dt) {
    double x[N], ignored, s = r->times[r->kept] - r->t;
    for (int i = 0; i < ND; i++) x[i] = horner(e->states[i], P, s, &ignored);
    sample(r, r->times[r->kept], x);
  }
}

static void count_hit(Run *r, int kind, const int *guard, const double *x) {
  const Options *o = &r->o;
  if (!(o->hit_kinds >> kind & 1) || !o->hit_named[guard[0] * o->hit_width + guard[1]]) return;
  if ((o->hit_side && guard[2] != o->hit_side) || r->t <= r->begun + AT_END * larger(1, fabs(r->begun))) return;
  r->hits++;
  if (r->hits <= o->hit_skip || (r->hits - o->hit_skip) % o->hit_every) return;
  sample(r, r->t, o->hit_after ? r->x : x);
  if (o->hit_count && r->hits >= o->hit_skip + o->hit_every * o->hit_count)
    finish(r, STOPPED, LOOKED_AT, (int)o->hit_count);
}

static void limit_of_events(Run *r);

/* ``x`` is the state at the event, the present one unless the event changed it. */
static void event(Run *r, int kind, int before, int guard, const double *x) {
  r->kinds[kind]++;
  r->event_count++;
  if (kind == r->o.at_kind && r->kinds[kind] == r->o.at_count) {
    r->at_t = r->t;
    memcpy(r->at_x, x, sizeof r->x);
  }
  if (r->o.dense) {
    int64_t k = r->out.events++;
    r->out.event_kind[k] = kind;
    r->out.event_t[k] = r->t;
    memcpy(r->out.event_x + k * N, x, sizeof r->x);
    memcpy(r->out.event_after_x + k * N, r->x, sizeof r->x);
    r->out.event_before[k] = before;
    r->out.event_after[k] = r->mode;
    r->out.event_guard[k] = guard;
  }
  if (r->o.hit_kinds) count_hit(r, kind, GUARD[before][guard], x);
  if (kind == END || kind == STOP) return;
  int at = r->history++ % HISTORY;
  r->interval[at] = r->t - r->last_event;
  r->pattern[at] = ((kind * 64 + guard + 1) * (MODES + 1) + before + 1) * (MODES + 1) + r->mode + 1;
  r->last_event = r->t;
  limit_of_events(r);
  if (r->event_count >= r->o.max_events) finish(r, TOO_MANY_EVENTS, NO_REASON, 0);
}

/* nonsmooth/flow/reference/accumulation.py */
static double interval_back(const Run *r, int back) { return r->interval[(r->history - back) % HISTORY]; }
static int pattern_back(const Run *r, int back) { return r->pattern[(r->history - back) % HISTORY]; }

static void limit_of_events(Run *r) {
  if (r->history > AT_ONCE) {
    int all_zero = 1;
    for (int k = 1; k <= AT_ONCE; k++) all_zero &= interval_back(r, k) == 0;
    if (all_zero) { r->limit = r->t; finish(r, ACCUMULATION, NO_REASON, 0); return; }
  }
  for (int l = 0; l < LAG_COUNT; l++) {
    int lag = LAGS[l], need = BLOCKS * lag, same = 1;
    if (r->history < need + lag) return;
    for (int k = 1; k <= need && same; k++) same = pattern_back(r, k) == pattern_back(r, k + lag);
    if (!same) continue;
    double block[BLOCKS], least = INFINITY, low = INFINITY, high = 0, ratio = 0;
    for (int b = 0; b < BLOCKS; b++) {
      block[b] = 0;
      for (int k = 0; k < lag; k++) block[b] += interval_back(r, need - b * lag - k);
      least = fmin(least, block[b]);
    }
    if (!(least > 0)) continue;
    for (int b = 1; b < BLOCKS; b++) {
      ratio = block[b] / block[b - 1];
      low = fmin(low, ratio);
      high = fmax(high, ratio);
    }
    if (!(high < SHRINKS && high - low <= SPREAD * (1 - ratio))) continue;
    double left = block[BLOCKS - 1] * ratio / (1 - ratio);
    if (left < REMAINING * (r->t - r->begun)) {
      r->limit = r->t + left;
      finish(r, ACCUMULATION, NO_REASON, 0);
      return;
    }
  }
}

/* Filippov's logic: nonsmooth/flow/reference/switching.py ---------------------------------------------- */

typedef struct { int mode, strict, drop[NG1]; } Continuation;

/* Both fields tangent to the surface that slides in a mode, at the present point. */
static int is_two_fold(const Run *r, int mode, double tolerance) {
  double value[NG1], gradient[NG1][N];
  guard_values(mode, r->x, r->q, value, &gradient[0][0]);
  for (int j = 0; j < GUARDS[mode]; j++) {
    if (GUARD[mode][j][0] != EXIT_GUARD) continue;
    double scale = rounding_scale(r, gradient[j]);
    if (!(fabs(value[j]) <= (tolerance + TANGENT) * scale && scale > 0)) return 0;
  }
  return 1;
}

/* Whether the motion can continue in a mode: its guards that vanish here become positive. */
static int continuation(Run *r, int mode, unsigned active, int exit_index, int exit_side,
                        Continuation *result) {
  Expansion e;
  expand(r, mode, &e);
  if (!e.finite) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
  result->mode = mode;
  result->strict = 1;
  memset(result->drop, 0, sizeof result->drop);
  for (int j = 0; j < GUARDS[mode]; j++) {
    const int *guard = GUARD[mode][j];
    if (guard[0] >= STOP_GUARD || !(active >> guard[1] & 1)) continue;
    int zeros = guard[0] == SURFACE_GUARD;
    if (guard[1] == exit_index && guard[2] == exit_side) zeros += 1;
    double value;
    int k = leading(&e, j, zeros, &value);
    if (value < 0) return 0;
    if (value == 0) result->strict = 0;
    result->drop[j] = value != 0 ? (k < P ? k : P) : P + 1;
  }
  return 1;
}

/* One surface with both fields clearly transversal: the signs of L_F1 h and L_F2 h decide. */
static int decide_quickly(Run *r, int mode, unsigned active, Continuation *result) {
  int i = 0, letters[M1];
  if (M == 0 || (active & (active - 1)) || !active) return 0;
  while (!(active >> i & 1)) i++;
  for (int j = 0; j < M; j++) letters[j] = LETTER[mode][j];
  letters[i] = 0;
  int sliding = mode_code(letters);
  if (sliding < 0) return 0;
  double value[NG1], gradient[NG1][N], fall[2] = {0, 0};
  guard_values(sliding, r->x, r->q, value, &gradient[0][0]);
  for (int j = 0; j < GUARDS[sliding]; j++) {
    const int *guard = GUARD[sliding][j];
    if (guard[0] != EXIT_GUARD) continue;
    double scale = rounding_scale(r, gradient[j]);
    if (!(fabs(value[j]) > VANISHES * scale && fabs(value[j]) < INFINITY)) return 0;
    fall[guard[2] < 0] = value[j]; /* -L_F1 h, L_F2 h */
  }
  if (fall[0] < 0 && fall[1] > 0) letters[i] = 1;
  else if (fall[0] > 0 && fall[1] < 0) letters[i] = -1;
  else if (fall[0] < 0) return 0;
  result->mode = mode_code(letters);
  result->strict = 1;
  memset(result->drop, 0, sizeof result->drop);
  for (int j = 0; j < GUARDS[result->mode]; j++)
    if (GUARD[result->mode][j][0] == SURFACE_GUARD && GUARD[result->mode][j][1] == i)
      result->drop[j] = 1;
  return 1;
}

/* Both fields tangent at the only active surface, and the sliding field 0/0. */
static int meets_two_fold(Run *r, int mode, unsigned active) {
  int i = 0, letters[M1];
  if (M == 0 || !active || (active & (active - 1))) return 0;
  while (!(active >> i & 1)) i++;
  for (int j = 0; j < M; j++) letters[j] = LETTER[mode][j];
  letters[i] = 0;
  int sliding = mode_code(letters);
  if (sliding < 0) return 0;
  if (CANCELLED[sliding]) return 0;
  if (!is_two_fold(r, sliding, 0)) return 0;
  finish(r, NON_UNIQUE, TWO_FOLD, i);
  return 1;
}

/* Whether sliding on two active surfaces at once is excluded: somewhere between the fields both
 * grad h . f would vanish, but one of them has a strict sign in all four. */
static int intersection_excluded(const Run *r, int mode, unsigned active) {
  double low[M1], high[M1];
  int count = 0;
  for (int i = 0; i < M; i++) { low[i] = INFINITY; high[i] = -INFINITY; count += active >> i & 1; }
  if (count != 2) return 0;
  for (int m = 0; m < MODES; m++) {
    int vertex = 1;
    for (int i = 0; i < M; i++)
      vertex &= active >> i & 1 ? LETTER[m][i] != 0 : LETTER[m][i] == LETTER[mode][i];
    if (!vertex) continue;
    Expansion e;
    expand(r, m, &e);
    for (int j = 0; j < GUARDS[m]; j++) {
      const int *guard = GUARD[m][j];
      if (guard[0] != SURFACE_GUARD) continue;
      low[guard[1]] = fmin(low[guard[1]], guard[2] * e.guards[j][1]);
      high[guard[1]] = fmax(high[guard[1]], guard[2] * e.guards[j][1]);
    }
  }
  for (int i = 0; i < M; i++)
    if ((active >> i & 1) && (low[i] > 1e-10 * high[i]) && low[i] > 0) return 1;
    else if ((active >> i & 1) && (high[i] < 1e-10 * low[i]) && high[i] < 0) return 1;
  return 0;
}

/* Choose the motion that continues from a point of the surfaces ``active``; 0 if the run ends.
 * ``mode`` has the letters of the other surfaces. */
static int decide(Run *r, int mode, unsigned active, int exit_index, int exit_side,
                  Continuation *chosen) {
  if (exit_index < 0 && decide_quickly(r, mode, active, chosen)) return 1;
  if (meets_two_fold(r, mode, active)) return 0;
  if ((active & (active - 1)) && !intersection_excluded(r, mode, active)) {
    finish(r, HAND_OVER, NO_REASON, 0);
    return 0;
  }
  int found = 0, strict = 0, resting = 0, where = 0;
  Continuation one = {0}, first = {0}, rest = {0};
  for (int m = 0; m < MODES && r->status == RUNNING; m++) {
    int fits = 1;
    for (int i = 0; i < M; i++)
      if (!(active >> i & 1) && LETTER[m][i] != LETTER[mode][i]) fits = 0;
    Continuation c;
    if (!fits || !continuation(r, m, active, exit_index, exit_side, &c)) continue;
    if (c.strict && strict++ == 0) one = c;
    if (c.strict) where |= m < 31 ? 1 << m : 0;
    if (found++ == 0) first = c;
    if (sliding_surface(m) >= 0 && resting++ == 0) rest = c;
  }
  if (r->status != RUNNING) return 0;
  if (strict == 1) *chosen = one;
  else if (!strict && found == 1) *chosen = first;
  else if (strict > 1) { finish(r, NON_UNIQUE, AMBIGUOUS, where); return 0; }
  else if (resting) *chosen = rest;
  else if (active & (active - 1)) { finish(r, HAND_OVER, NO_REASON, 0); return 0; }
  else { finish(r, NON_UNIQUE, DEGENERATE, (int)active); return 0; }
  return 1;
}

/* Events: nonsmooth/flow/reference/driver.py ----------------------------------------------------------- */

static int change_kind(int before, int after) {
  int was = sliding_surface(before) >= 0, is = sliding_surface(after) >= 0;
  return is > was ? ENTRY : is < was ? EXIT : CROSSING;
}

static void adopt(Run *r, const Continuation *c) {
  enter_segment(r, c->mode);
  r->mode = c->mode;
  memcpy(r->drop, c->drop, sizeof r->drop);
}

/* Adopt the mode that continues; 0 where there is none or more than one. */
static int choose(Run *r, int letters, unsigned active, int exit_index, int exit_side) {
  Continuation c = {letters, 1, {0}};
  if (active && !decide(r, letters, active, exit_index, exit_side, &c)) return 0;
  adopt(r, &c);
  return 1;
}

static int mode_by_signs(const Run *r, int *finite) {
  double h[M1], g[M1][N];
  int letters[M1];
  *finite = 1;
  if (M > 0) {
    surface_values(r->x, r->q, h, &g[0][0]);
    *finite = finite_all(h, M);
  }
  for (int i = 0; i < M; i++) letters[i] = h[i] > 0 ? 1 : -1;
  return mode_code(letters);
}

static void start_in(Run *r, int mode, unsigned active) {
  for (int i = 0; i < M; i++)
    if (!(active >> i & 1) && LETTER[mode][i] != LETTER[r->mode][i]) {
      finish(r, NON_UNIQUE, WRONG_START, r->mode);
      return;
    }
  Expansion e;
  r->mode = mode;
  expand(r, mode, &e);
  for (int j = 0; j < GUARDS[mode]; j++) {
    const int *guard = GUARD[mode][j];
    if (guard[0] >= STOP_GUARD || !(active >> guard[1] & 1)) continue;
    double value;
    int k = leading(&e, j, guard[0] == SURFACE_GUARD, &value);
    r->drop[j] = k;
    if (value < 0) { /* repelling sliding, or a mode that cannot hold: the reference knows which */
      finish(r, HAND_OVER, NO_REASON, 0);
      return;
    }
  }
}

/* After a reset that stays on its zero the motion turns round or passes; or it is pressed. */
static void pass(Run *r, const int *guard, int zeros, double value, int side) {
  int heading = side ? -side : guard[2];
  if (zeros > 1 && value * heading > 0) {
    r->limit = r->t;
    finish(r, ACCUMULATION, PRESSED, guard[1]);
  }
}

/* Whether a start on the zero of a reset is met at once. */
static int is_pressed(Run *r, int row, double value) {
  const int *guard = GUARD[r->mode][row];
  if (guard[2]) return value * guard[2] > 0;
  Run after = *r;
  Expansion e;
  double back;
  reset_map(guard[1], r->x, r->q, after.x);
  if (TIMED) after.x[N - 1] = r->x[N - 1];
  expand(&after, r->mode, &e);
  int zeros = leading(&e, row, 0, &back), least = zeros < r->drop[row] ? zeros : r->drop[row];
  if (zeros > 0 && (back * value <= 0 || least > 1)) finish(r, NON_UNIQUE, TWO_SIDED, guard[1]);
  return 0;
}

/* The stop or reset, on whose zero the run stands, that is met; ``fired`` is the reset that led here or
 * -1. */
static void arm(Run *r, int fired) {
  int needed = 0;
  r->due = -1;
  if (r->status != RUNNING) return;
  for (int j = 0; j < GUARDS[r->mode]; j++) needed |= GUARD[r->mode][j][0] >= STOP_GUARD;
  if (!needed) return;
  Expansion e;
  expand(r, r->mode, &e);
  for (int j = 0; j < GUARDS[r->mode]; j++) {
    const int *guard = GUARD[r->mode][j];
    double value;
    if (guard[0] < STOP_GUARD) continue;
    r->drop[j] = leading(&e, j, 0, &value);
    int resets = guard[0] == RESET_GUARD, *kept = &r->side[resets][guard[1]], side = *kept, met = 0;
    if (r->drop[j] == 0) *kept = value > 0 ? 1 : -1; /* where a jump carried it is no passage */
    if (r->drop[j] == 0 || value == 0) continue;
    if (resets && guard[1] == fired) pass(r, guard, r->drop[j], value, side);
    else if (resets && r->fired[guard[1]]) continue;
    else if (side) met = side * value < 0 && side * guard[2] <= 0;
    else if (resets) met = is_pressed(r, j, value);
    if (met && (r->due < 0 || PRIORITY[guard[0]] < PRIORITY[GUARD[r->mode][r->due][0]])) r->due = j;
  }
}

static void begin(Run *r) {
  int finite;
  note(r);
  r->mode = mode_by_signs(r, &finite);
  if (!finite) { finish(r, NOT_FINITE, SURFACE, 0); return; }
  unsigned active = active_surfaces(r, 0, r->mode);
  project(r, active);
  renote(r);
  if (r->o.start_mode >= 0) start_in(r, r->o.start_mode, active);
  else if (active) {
    Continuation c;
    if (decide(r, r->mode, active, -1, 0, &c)) {
      r->mode = c.mode;
      memcpy(r->drop, c.drop, sizeof r->drop);
    }
  }
  enter_segment(r, r->mode);
  arm(r, -1);
}

static void reset(Run *r, int row) {
  double x[N];
  int finite, before = r->mode, index = GUARD[before][row][1];
  memcpy(x, r->x, sizeof x);
  reset_map(index, x, r->q, r->x);
  if (finite_all(r->x, ND)) {
    note(r);
    int letters = mode_by_signs(r, &finite);
    choose(r, letters, active_surfaces(r, 0, letters), -1, 0);
  } else {
    memcpy(r->x, x, sizeof x);
    finish(r, NOT_FINITE, RESET_MAP, index);
  }
  event(r, RESET, before, row, x);
  r->fired[index] = 1;
  arm(r, index);
}

static void watch_two_fold(Run *r) {
  int s = sliding_surface(r->mode);
  if (s < 0 || CANCELLED[r->mode]) return;
  if (is_two_fold(r, r->mode, r->o.rtol)) finish(r, NON_UNIQUE, SLID_TO_TWO_FOLD, s);
}

static void serve(Run *r, int row) {
  const int *guard = GUARD[r->mode][row];
  if (guard[0] == STOP_GUARD) {
    event(r, STOP, r->mode, row, r->x);
    finish(r, STOPPED, NO_REASON, guard[1]);
  } else if (guard[0] == RESET_GUARD) {
    reset(r, row);
  } else {
    unsigned active = active_surfaces(r, 1u << guard[1], r->mode);
    int exits = guard[0] == EXIT_GUARD;
    project(r, active);
    renote(r);
    if (exits) watch_two_fold(r);
    else if (!is_on(r, guard[1])) finish(r, NON_UNIQUE, MULTIPLE_ZERO, guard[1]);
    if (r->status != RUNNING) return;
    int before = r->mode;
    if (choose(r, before, active, exits ? guard[1] : -1, guard[2]) && r->mode != before)
      event(r, change_kind(before, r->mode), before, row, r->x);
  }
}

/* 0 where the state after the step is not finite; the run then ends before it. */
static int advance(Run *r, const Expansion *e, double dt) {
  double x[N];
  for (int i = 0; i < N; i++) {
    double v = e->states[i][P];
    for (int k = P - 1; k >= 0; k--) v = v * dt + e->states[i][k];
    x[i] = v;
  }
  if (!finite_all(x, N)) { finish(r, NOT_FINITE, STATE, 0); return 0; }
  if (r->o.dense) {
    int64_t k = r->out.steps++;
    r->out.start[k] = r->t;
    r->out.step_mode[k] = r->mode;
    memcpy(r->out.coefficients + k * N * (P + 1), e->states, sizeof e->states);
  }
  if (r->times) sample_step(r, e, dt);
  memcpy(r->x, x, sizeof x);
  r->t += dt;
  r->step_count++;
  r->segment_steps++;
  if (TIMED) r->x[N - 1] = r->t;
  int s = sliding_surface(r->mode);
  if (s >= 0) project(r, 1u << s);
  memset(r->drop, 0, sizeof r->drop);
  note(r);
  return 1;
}

static void step(Run *r) {
  if (r->due >= 0) { serve(r, r->due); return; }
  double left = r->o.t_end - r->t, dt;
  if (left <= 0) { finish(r, REACHED_END, NO_REASON, 0); return; }
  if (r->step_count >= r->o.max_steps) { finish(r, TOO_MANY_STEPS, NO_REASON, 0); return; }
  Expansion e;
  expand(r, r->mode, &e);
  if (!e.finite) { finish(r, HAND_OVER, NO_REASON, 0); return; }
  double by_series = step_size(r, &e), h = smaller(by_series, r->o.max_step);
  if (h <= SHORTEST * larger(fabs(r->t), fabs(r->t - r->begun)) && h < left) {
    finish(r, STEP_TOO_SMALL, r->shortened > SHORTENED / 10 ? BRANCH_POINT : NO_REASON, 0);
    return;
  }
  int last = h >= left;
  if (last) h = left;
  /* What happens at the end, to rounding, happens. */
  int row = first_hit(r, &e, last ? h + AT_END * larger(1, fabs(r->t + h)) : h, &dt);
  dt = row < 0 ? h : smaller(dt, h);
  double wanted = dt;
  double safe = safe_length(r, &e, by_series), good;
  while (dt > 0 && (good = verified(r, &e, dt, row >= 0 && dt == wanted ? BEFORE_EVENT : JUST, safe)) < dt)
    dt = good;
  int held = dt > STEADY * r->length && (dt > r->length / STEADY || dt > wanted / FAR);
  int shrinks = dt < wanted && !(r->mode == r->length_mode && held);
  r->shortened = larger(0, r->shortened + (shrinks ? 1 : -0.2));
  r->length_mode = r->mode;
  r->length = dt == wanted ? h : dt;
  int swallowed = dt < wanted && dt <= SHORTEST * fabs(r->t); /* close to t = 0 steps may be tiny */
  if (r->shortened >= SHORTENED || swallowed) { finish(r, STEP_TOO_SMALL, BRANCH_POINT, 0); return; }
  if (dt < wanted) { row = -1; last = 0; }
  if (dt > 0) {
    note_sides(r, &e, dt);
    memset(r->fired, 0, sizeof r->fired);
  }
  if (!advance(r, &e, dt)) return;
  last &= dt == h;
  if (last) {
    r->t = r->o.t_end;
    if (TIMED) r->x[N - 1] = r->t;
    if (r->o.dense) r->out.point_t[r->out.points - 1] = r->t;
  }
  if (row >= 0) serve(r, row);
  else if (!last) watch_two_fold(r);
}

/* The last mode counts only if it lasted for a step (or is the only one). */
static int32_t final_itinerary(const Run *r) {
  int32_t above = r->tree->node[r->itinerary].parent;
  return r->segment_steps == 0 && above > 0 ? above : r->itinerary;
}

/* Entry points --------------------------------------------------------------------------------- */

int64_t run_size(void) { return sizeof(Run); }
int64_t output_size(void) { return sizeof(Output); }

void run_begin(Run *r, const Options *o, const Output *out, Tree *tree, const double *x,
               const double *p, double t) {
  memset(r, 0, sizeof *r);
  r->o = *o;
  r->size = o->atol / o->rtol;
  r->out = *out;
  r->tree = tree;
  memcpy(r->x, x, sizeof r->x);
  prepare(p, r->q);
  r->t = r->begun = r->last_event = t;
  r->limit = r->at_t = NAN;
  for (int i = 0; i < N; i++) r->at_x[i] = NAN;
  r->status = RUNNING;
  r->segment_mode = r->due = r->length_mode = -1;
  if (finite_all(r->x, N)) begin(r);
  else { r->status = NOT_FINITE; r->reason = SURFACE; }
}

/* Go on until the run ends, its arrays have no room for another step (FULL), or ``budget`` steps are
 * done (RUNNING). */
static int go_on(Run *r, int64_t *budget) {
  while (r->status == RUNNING) {
    if (r->o.dense && (r->out.steps >= r->out.step_room || r->out.points + 3 > r->out.point_room
                       || r->out.events + 4 > r->out.event_room))
      return FULL;
    if (--*budget < 0) return RUNNING;
    step(r);
  }
  return r->status;
}

int run_continue(Run *r) {
  int64_t budget = INT64_MAX;
  return go_on(r, &budget);
}

void run_read(const Run *r, double *numbers, int64_t *counts) {
  numbers[0] = r->t;
  numbers[1] = r->limit;
  numbers[2] = r->at_t;
  memcpy(numbers + 3, r->x, sizeof r->x);
  memcpy(numbers + 3 + N, r->at_x, sizeof r->at_x);
  int64_t head[] = {r->status, r->reason, r->where, r->mode, final_itinerary(r), r->step_count,
                    r->event_count, r->out.steps, r->out.points, r->out.events};
  memcpy(counts, head, sizeof head);
  memcpy(counts + 10, r->kinds, sizeof r->kinds);
}

/* Go on with other, empty arrays. */
void run_resume(Run *r, const Output *out) { r->out = *out; }

typedef struct { int64_t next, begun; Run run; } Many;

int64_t many_size(void) { return sizeof(Many); }

static void sample_into(Run *r, const Batch *b, int64_t i) {
  r->room = b->room;
  r->times = b->times ? b->times + i * b->times_stride : 0;
  r->sample_t = b->sample_t + i * b->room;
  r->sample_x = b->sample_x + i * b->room * ND;
}

static void keep(Run *r, const Batch *b, int64_t i) {
  while (r->times && r->kept < r->room && r->times[r->kept] <= r->t && finite_all(r->x, ND))
    sample(r, r->times[r->kept], r->x);
  memcpy(b->x + i * ND, r->x, ND * sizeof(double));
  b->t[i] = r->t;
  b->status[i] = (int8_t)r->status;
  b->itinerary[i] = final_itinerary(r);
  for (int j = 0; j < KINDS; j++) b->kinds[i * KINDS + j] = (int32_t)r->kinds[j];
  b->kinds[i * KINDS + END] += r->status != STOPPED;
  if (b->at_x) { memcpy(b->at_x + i * ND, r->at_x, ND * sizeof(double)); b->at_t[i] = r->at_t; }
  b->totals[0] += r->step_count;
  b->totals[1] += r->event_count;
}

/* Run a batch, ``budget`` steps of it at most; whether something is left for another call. ``many``
 * is zero before the first. */
int run_many(Many *many, const Batch *b, const Options *o, Tree *tree, int64_t budget) {
  static const Output none;
  Run *r = &many->run;
  for (; many->next < b->count; many->next++) {
    int64_t i = b->which ? b->which[many->next] : many->next;
    if (!many->begun) {
      run_begin(r, o, &none, tree, b->x0 + i * N, b->p + i * b->p_stride, b->t0);
      sample_into(r, b, i);
    }
    many->begun = 1;
    if (go_on(r, &budget) == RUNNING) return 1;
    many->begun = 0;
    keep(r, b, i);
  }
  return 0;
}
