/* Contacts of two parts for MuJoCo's solver: points of each looked up in the other's signed distance.

   Contact: dist = distance, normal = its gradient, position half the depth from the point along it. The deepest comes
   first, then whichever is farthest from those taken, in place and in normal, so that few contacts carry all.
   Points that are far from the other part are not asked again until something has moved as far as they are away: what is
   found is the same to the bit (Verlet 1967, Physical Review 159, whose lists these are).
   The names and the call are those of MuJoCo's table of collision functions; its version is checked when this is built. */
#include <mujoco/mujoco.h>
#include <stdlib.h>

#include "surfaces.h"

#if mjVERSION_HEADER != SKILLFRAME_MUJOCO
#error "these are headers of another MuJoCo than the one that runs"
#endif

#define PARTS 1024
#define MOST 24          /* contacts of a pair */
#define CANDIDATES 4096
#define TURNING 0.010    /* m; by how much normals of 90 degrees apart count as farther apart in place, over sqrt 2 */
#define AROUND 4.27      /* cells around a whole part, within its widest grid; a tenth of one less than there are */
#define SURELY 0.5       /* cells; what interpolates to more is outside, whatever edge is near (it is off by a quarter) */

#define ROUGH 0.3        /* cells; by how much less than interpolated a distance can be, and some more */
#define EXACT 1e-5       /* m; the same where it is linear within a cell, or exact */
#define AHEAD 3e-4       /* m; points nearer than this are asked until one of them may have moved so far */
#define TOGETHER 16      /* points that memory is called for at a time */
#define BLOCK 32         /* points of a list that are passed over at once where none may have come near */
#define LISTS 4096       /* of a thread; by simulation, part and part */

static const Part* parts[PARTS];
static int64_t changes;  /* of that table: what was kept of other parts is not of these */

typedef struct {
  double turn[9], shift[3];
} Frame;

typedef struct {
  double dist, pos[3], normal[3], apart;
} Candidate;

static _Thread_local Candidate candidates[CANDIDATES];

static INLINE void apply(const Frame* f, const double* p, double* out) {
  for (int x = 0; x < 3; x++) out[x] = dot(f->turn + 3 * x, p) + f->shift[x];
}

/* a after b */
static Frame after(const Frame* a, const Frame* b) {
  Frame out;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      out.turn[3 * i + j] = a->turn[3 * i] * b->turn[j] + a->turn[3 * i + 1] * b->turn[3 + j] + a->turn[3 * i + 2] * b->turn[6 + j];
  apply(a, b->shift, out.shift);
  return out;
}

static Frame inverse(const Frame* f) {
  Frame out;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) out.turn[3 * i + j] = f->turn[3 * j + i];
  for (int i = 0; i < 3; i++) out.shift[i] = -dot(out.turn + 3 * i, f->shift);
  return out;
}

static double in_list(const Part* part, const Grid* g, int64_t rank, const double* p, double* normal) {
  double best = 1e9, c[3], d[3], out[3] = {0, 0, 0};
  const double* face = part->mesh.normal;
  int inside = 0;
  for (int32_t n = g->start[rank]; n < g->start[rank + 1]; n++) {
    int64_t t = g->triangle[n];
    const double* corner = part->mesh.corner + 9 * t;
    int feature = nearest_on(corner, p, c);
    for (int x = 0; x < 3; x++) d[x] = p[x] - c[x];
    double size = dot(d, d);
    if (size >= best) continue;
    best = size, face = part->mesh.normal + 21 * t + 3 * feature, inside = dot(d, face) < 0;
    memcpy(out, d, sizeof out);
  }
  best = sqrt(best);
  for (int x = 0; x < 3; x++) normal[x] = best > 1e-9 ? (inside ? -out[x] : out[x]) / best : face[x];
  return inside ? -best : best;
}

/* What a grid says of a point p of the part's frame that lies at w within the cell of a node; normals where it is negative. */
static double in_cell(const Part* part, const Grid* g, int64_t node, const double* w, const double* p, double* normal) {
  int64_t sx = g->size[1] * g->size[2], sy = g->size[2];
  const float* v = g->value + node;
  double a00 = v[0] + w[2] * (v[1] - v[0]), a01 = v[sy] + w[2] * (v[sy + 1] - v[sy]);
  double a10 = v[sx] + w[2] * (v[sx + 1] - v[sx]), a11 = v[sx + sy] + w[2] * (v[sx + sy + 1] - v[sx + sy]);
  double b0 = a00 + w[1] * (a01 - a00), b1 = a10 + w[1] * (a11 - a10), value = b0 + w[0] * (b1 - b0);
  if (value > SURELY * g->cell) return value;
  uint64_t word = g->listed[node >> 6], bit = (uint64_t)1 << (node & 63);
  if (word & bit)
    return in_list(part, g, (int64_t)g->before[node >> 6] + ones(word & (bit - 1)), p, normal);
  if (value < 0) {
    double z00 = v[1] - v[0], z01 = v[sy + 1] - v[sy], z10 = v[sx + 1] - v[sx], z11 = v[sx + sy + 1] - v[sx + sy];
    double z0 = z00 + w[1] * (z01 - z00), z1 = z10 + w[1] * (z11 - z10);
    normal[0] = b1 - b0;
    normal[1] = (a01 - a00) + w[0] * ((a11 - a10) - (a01 - a00));
    normal[2] = z0 + w[0] * (z1 - z0);
    double size = sqrt(dot(normal, normal));
    for (int x = 0; x < 3; x++) normal[x] = size > 0 ? normal[x] / size : x == 2;
  }
  return value;
}

/* A grid as a moving part sees it: `turn` and `shift` take a point of that part to cells. `cells` of 0: not there. */
typedef struct {
  double turn[9], shift[3], cells[3];
  int64_t step[2];
  const Grid* grid;
} View;

/* What points are looked up in: a part, seen on two levels, or a box of these half sizes. */
typedef struct {
  const Part* part;
  const double* half;
  Frame across; /* from the points' frame to its own */
  View view[2];
} Shape;

static Shape seen(const Part* part, const double* half, const Frame* across) {
  Shape in = {part, half, *across, {{{0}}}};
  for (int level = 0; part && level < 2; level++) {
    const Grid* g = part->grid + level;
    View* view = in.view + level;
    view->grid = g, view->step[0] = g->size[1] * g->size[2], view->step[1] = g->size[2];
    if (!g->size[0]) continue;
    for (int x = 0; x < 3; x++) {
      for (int y = 0; y < 3; y++) view->turn[3 * x + y] = across->turn[3 * x + y] / g->cell;
      view->shift[x] = (across->shift[x] - g->origin[x]) / g->cell;
      view->cells[x] = (double)(g->size[x] - 1);
    }
  }
  return in;
}

/* The node at which a point's cell begins, and where it lies in it; -1 outside, and for what is no number. */
static INLINE int64_t cell_at(const View* v, const double* p, double* at) {
  for (int x = 0; x < 3; x++) {
    at[x] = dot(v->turn + 3 * x, p) + v->shift[x];
    if (!(at[x] >= 0 && at[x] < v->cells[x])) return -1;
  }
  int64_t i = (int64_t)at[0], j = (int64_t)at[1], k = (int64_t)at[2];
  at[0] -= (double)i, at[1] -= (double)j, at[2] -= (double)k;
  return i * v->step[0] + j * v->step[1] + k;
}

/* Call for what will be read about some points, so that one waits for memory once and not point by point. */
static INLINE void call_for(const View* view, const double* point, int values) {
  double w[3];
  for (int level = 0; level < 2; level++) {
    int64_t node = cell_at(view + level, point, w);
    if (node < 0) continue;
    const Grid* g = view[level].grid;
    __builtin_prefetch(g->gap + node);
    if (!values) return;
    const float* v = g->value + node;
    int64_t sx = view[level].step[0], sy = view[level].step[1];
    __builtin_prefetch(v), __builtin_prefetch(v + sy), __builtin_prefetch(v + sx), __builtin_prefetch(v + sx + sy);
    return;
  }
}

/* Depth of a point in a box, below zero, and the normal of the face that is nearest; above zero outside. */
static double in_box(const double* half, const double* p, double* normal) {
  double value = -1e9;
  int face = 0;
  for (int x = 0; x < 3; x++)
    if (fabs(p[x]) - half[x] > value) value = fabs(p[x]) - half[x], face = x;
  for (int x = 0; x < 3; x++) normal[x] = x == face ? (p[x] < 0 ? -1 : 1) : 0;
  return p[0] == p[0] ? value : 1e9;
}

/* Signed distance of a point, and its gradient where that is negative. `p` becomes the point in the shape's own frame.
   With `only_inside` it is 1e9 where one byte tells that it is positive, as of most points. */
static INLINE double distance_at(const Shape* in, int only_inside, const double* point, double* p, double* normal) {
  double w[3];
  if (!in->half)
    for (int level = 0; level < 2; level++) {
      const View* view = in->view + level;
      int64_t node = cell_at(view, point, w);
      if (node < 0) continue;
      if (only_inside && view->grid->gap[node]) return 1e9;
      apply(&in->across, point, p);
      return in_cell(in->part, view->grid, node, w, p, normal);
    }
  if (!in->half) return 1e9;
  apply(&in->across, point, p);
  return in_box(in->half, p, normal);
}

/* How far around a place every point is surely outside a shape; below zero where the place itself may be inside. */
static double clear_by(const Shape* in, const double* place) {
  double w[3], p[3];
  if (in->half) {
    apply(&in->across, place, p);
    return in_box(in->half, p, w);
  }
  const View* whole = in->view + (in->view[1].cells[0] > 0);
  double beside = 0;
  for (int x = 0; x < 3; x++) {
    double at = dot(whole->turn + 3 * x, place) + whole->shift[x];
    double away = larger(AROUND - at, at - whole->cells[x] + AROUND) * whole->grid->cell;
    if (away > 0) beside += away * away;
  }
  beside = beside > 0 ? sqrt(beside) : -1;
  for (int level = 0; level < 2; level++) {
    const View* view = in->view + level;
    int64_t node = cell_at(view, place, w);
    if (node >= 0) return larger(beside, CLEAR * view->grid->cell * ((double)view->grid->gap[node] - 1));
  }
  return beside;
}

/* Whether no point of a ball can be in a shape. */
static int is_clear(const Shape* in, const double* centre, double radius) { return clear_by(in, centre) > radius; }

/* How far a place that may be near the surface can surely move before it is inside; below zero where it may be. What is
   seen there is the distance: to the bit in a cell with a list, else where it is linear, or off by what SURELY says. */
static double moves_by(const Shape* in, const double* place) {
  double w[3], p[3], normal[3], by = clear_by(in, place);
  for (int level = 0; in->part && in->part->agrees && level < 2; level++) {
    const View* view = in->view + level;
    int64_t node = cell_at(view, place, w);
    if (node < 0) continue;
    double cell = view->grid->cell, seen = (apply(&in->across, place, p), in_cell(in->part, view->grid, node, w, p, normal));
    return larger(by, seen > SURELY * cell ? seen / LOOSE - ROUGH * cell : seen - EXACT);
  }
  return by;
}

/* Points of a part that may be within AHEAD of another, in order, as both stood then, how far each could move yet, and the
   least of that in each block of them. */
typedef struct {
  const void* data;
  const Part *of, *in;
  Frame across;
  double centre[3], radius; /* of a ball around all points */
  int64_t changes, count, room;
  int32_t* point;
  float *moves, *least;
} Near;

static _Thread_local Near* lists;

/* Where a simulation's list of a pair is, or may be put; NULL without memory. */
static Near* list_of(const void* data, const Part* of, const Part* in) {
  if (!lists && !(lists = calloc(LISTS, sizeof(Near)))) return NULL;
  uint64_t h = ((uint64_t)(uintptr_t)data >> 4) * 0x9e3779b97f4a7c15u;
  h = (h ^ ((uint64_t)(uintptr_t)of >> 4)) * 0x9e3779b97f4a7c15u;
  h = (h ^ ((uint64_t)(uintptr_t)in >> 4)) * 0x9e3779b97f4a7c15u >> 32;
  for (uint64_t k = 0; k < 4; k++) {
    Near* here = lists + ((h + k) & (LISTS - 1));
    if (!here->data || (here->data == data && here->of == of && here->in == in)) return here;
  }
  return lists + (h & (LISTS - 1));
}

/* How far any point may have moved against the other part since a list was made; AHEAD where there is none that is good. */
static double moved_since(const Near* near, const void* data, const Part* of, const Part* in, const Frame* across) {
  if (near->data != data || near->of != of || near->in != in || near->changes != changes) return AHEAD;
  Frame by;
  double turned = 0, moved[3];
  for (int i = 0; i < 9; i++) by.turn[i] = across->turn[i] - near->across.turn[i], turned += by.turn[i] * by.turn[i];
  for (int x = 0; x < 3; x++) by.shift[x] = across->shift[x] - near->across.shift[x];
  apply(&by, near->centre, moved);
  return 1.001 * (sqrt(turned) * near->radius + sqrt(dot(moved, moved)));
}

/* Room for one more point; 0 without memory, and then the list is of no pair. */
static int has_room(Near* near) {
  if (near->count < near->room) return 1;
  int64_t room = near->room ? 2 * near->room : 256;
  int32_t* point = realloc(near->point, (size_t)room * sizeof *point);
  if (point) near->point = point;
  float* moves = realloc(near->moves, (size_t)room * sizeof *moves);
  if (moves) near->moves = moves;
  float* least = realloc(near->least, (size_t)(room / BLOCK) * sizeof *least);
  if (least) near->least = least;
  if (point && moves && least) near->room = room;
  else near->of = NULL;
  return point && moves && least;
}

/* Make a list. */
static void make_list(Near* near, const void* data, const Part* of, const Part* in, const Shape* shape) {
  near->data = data, near->of = of, near->in = in, near->across = shape->across, near->changes = changes;
  near->count = 0, near->radius = 0;
  for (int x = 0; x < 3; x++) {
    near->centre[x] = 0;
    for (int64_t a = 0; a < of->groups; a++) near->centre[x] += of->around[4 * a + x] / (double)of->groups;
  }
  for (int64_t a = 0; a < of->groups; a++) {
    double from[3];
    for (int x = 0; x < 3; x++) from[x] = of->around[4 * a + x] - near->centre[x];
    near->radius = larger(near->radius, sqrt(dot(from, from)) + of->around[4 * a + 3]);
    if (is_clear(shape, of->around + 4 * a, of->around[4 * a + 3] + AHEAD)) continue;
    for (int64_t b = of->group[a]; b < of->group[a + 1]; b++) {
      if (is_clear(shape, of->ball + 4 * b, of->ball[4 * b + 3] + AHEAD)) continue;
      for (int64_t i = of->first[b]; shape->part && i < of->first[b + 1]; i++) call_for(shape->view, of->point + 3 * i, 0);
      for (int64_t i = of->first[b]; i < of->first[b + 1]; i++) {
        if (is_clear(shape, of->point + 3 * i, AHEAD)) continue;
        if (!has_room(near)) return;
        float by = (float)(0.999 * moves_by(shape, of->point + 3 * i)), *least = near->least + near->count / BLOCK;
        if (near->count % BLOCK == 0 || by < *least) *least = by;
        near->moves[near->count] = by, near->point[near->count++] = (int32_t)i;
      }
    }
  }
}

/* Add what a point finds in the other part; `sign` turns gradients to normals from the first to the second. */
static INLINE int ask(const Shape* in, const Frame* pose_in, const double* point, double sign, int found) {
  double p[3], normal[3], dist = distance_at(in, 1, point, p, normal);
  if (!(dist < 0)) return found;
  Candidate* c = candidates + found;
  for (int x = 0; x < 3; x++) p[x] -= 0.5 * dist * normal[x];
  apply(pose_in, p, c->pos);
  for (int x = 0; x < 3; x++) c->normal[x] = sign * dot(pose_in->turn + 3 * x, normal);
  c->dist = dist, c->apart = 1e9;
  return found + 1;
}

/* Add what the points of one part find in the other. `data` says whose list of near points is kept, NULL: none is. */
static int look(const void* data, const Part* of, const Frame* pose_of, const Part* part, const double* half,
                const Frame* pose_in, double sign, int found) {
  Frame back = inverse(pose_in), across = after(&back, pose_of);
  Shape in = seen(part, half, &across);
  Near* near = data ? list_of(data, of, part) : NULL;
  double moved = near ? moved_since(near, data, of, part, &across) : 0;
  if (near && moved >= AHEAD) make_list(near, data, of, part, &in), moved = 0;
  if (near && near->of) {
    for (int64_t n = 0; n < near->count;) {
      const double* point[TOGETHER];
      int asked = 0;
      while (n < near->count && asked < TOGETHER) {
        if (n % BLOCK == 0 && near->least[n / BLOCK] > moved) {
          n += BLOCK;
          continue;
        }
        if (near->moves[n] <= moved) {
          point[asked] = of->point + 3 * near->point[n];
          call_for(in.view, point[asked++], 1);
        }
        n++;
      }
      for (int i = 0; i < asked && found < CANDIDATES; i++) found = ask(&in, pose_in, point[i], sign, found);
    }
    return found;
  }
  for (int64_t a = 0; a < of->groups; a++) {
    if (is_clear(&in, of->around + 4 * a, of->around[4 * a + 3])) continue;
    for (int64_t b = of->group[a]; b < of->group[a + 1]; b++) {
      if (is_clear(&in, of->ball + 4 * b, of->ball[4 * b + 3])) continue;
      for (int64_t i = of->first[b]; i < of->first[b + 1] && found < CANDIDATES; i++)
        found = ask(&in, pose_in, of->point + 3 * i, sign, found);
    }
  }
  return found;
}

/* Write the deepest candidate, then the farthest from those written, while any is farther than `apart`. */
static int choose(int found, double apart, mjPreContact* con) {
  int count = 0, next = -1;
  for (int i = 0; i < found; i++)
    if (next < 0 || candidates[i].dist < candidates[next].dist) next = i;
  while (next >= 0 && count < MOST) {
    Candidate taken = candidates[next];
    mjPreContact* out = con + count++;
    out->dist = taken.dist;
    for (int x = 0; x < 3; x++) out->pos[x] = taken.pos[x], out->normal[x] = taken.normal[x], out->tangent[x] = 0;
    next = -1;
    for (int i = 0; i < found; i++) {
      Candidate* c = candidates + i;
      double away[3], turned[3];
      for (int x = 0; x < 3; x++) {
        away[x] = c->pos[x] - taken.pos[x];
        turned[x] = TURNING * (c->normal[x] - taken.normal[x]);
      }
      c->apart = smaller(sqrt(dot(away, away)) + sqrt(dot(turned, turned)), c->apart);
      if (c->apart > apart && (next < 0 || c->apart > candidates[next].apart)) next = i;
    }
  }
  return count;
}

static const Part* part_of(const mjModel* m, const mjData* d, int geom, Frame* pose) {
  int slot = m->nuser_geom ? (int)m->geom_user[geom * m->nuser_geom] - 1 : -1;
  if (slot < 0 || slot >= PARTS || !parts[slot]) {
    mju_error("geom %d has no surface in skillframe's table of parts", geom);
    return NULL;
  }
  Frame body, own;
  memcpy(body.turn, d->xmat + 9 * m->geom_bodyid[geom], sizeof body.turn);
  memcpy(body.shift, d->xpos + 3 * m->geom_bodyid[geom], sizeof body.shift);
  memcpy(own.turn, parts[slot]->turn, sizeof own.turn);
  memcpy(own.shift, parts[slot]->shift, sizeof own.shift);
  *pose = after(&body, &own);
  return parts[slot];
}

static int collide(const mjModel* m, mjData* d, mjPreContact* con, int g1, int g2, mjtNum margin) {
  Frame f1, f2;
  const Part *one = part_of(m, d, g1, &f1), *two = part_of(m, d, g2, &f2);
  (void)margin;
  if (!one || !two) return 0;
  int found = look(d, one, &f1, two, NULL, &f2, -1.0, 0);
  found = look(d, two, &f2, one, NULL, &f1, 1.0, found);
  return choose(found, smaller(one->apart, two->apart), con);
}

/* A box, as a table, and a part: the part's points alone, since no edge of a table is sampled. */
static int collide_box(const mjModel* m, mjData* d, mjPreContact* con, int g1, int g2, mjtNum margin) {
  Frame box, pose;
  const Part* part = part_of(m, d, g2, &pose);
  (void)margin;
  if (!part) return 0;
  memcpy(box.turn, d->geom_xmat + 9 * g1, sizeof box.turn);
  memcpy(box.shift, d->geom_xpos + 3 * g1, sizeof box.shift);
  return choose(look(NULL, part, &pose, NULL, m->geom_size + 3 * g1, &box, 1.0, 0), part->apart, con);
}

EXPORT int skillframe_version(void) { return mjVERSION_HEADER; }

/* Take the pairs (sdf, sdf) and (box, sdf) of MuJoCo's table. */
EXPORT void skillframe_install(mjfCollision table[mjNGEOMTYPES][mjNGEOMTYPES]) {
  table[mjGEOM_SDF][mjGEOM_SDF] = collide;
  table[mjGEOM_BOX][mjGEOM_SDF] = collide_box;
}

/* Put a part into the first free slot; returns its number from 1 on, 0 where all are taken. */
EXPORT int skillframe_add(const Part* part) {
  for (int slot = 0; slot < PARTS; slot++)
    if (!parts[slot]) {
      parts[slot] = part, changes++;
      return slot + 1;
    }
  return 0;
}

EXPORT void skillframe_remove(int number) { parts[number - 1] = NULL, changes++; }

/* Whether lists and values agree on what is inside, at every corner of a cell with a list: not where a mesh crosses itself. */
EXPORT int skillframe_agrees(const Part* part) {
  for (int level = 0; level < 2; level++) {
    const Grid* g = part->grid + level;
    int64_t rank = 0;
    for (int64_t i = 0; i + 1 < g->size[0]; i++)
      for (int64_t j = 0; j + 1 < g->size[1]; j++)
        for (int64_t k = 0; k + 1 < g->size[2]; k++) {
          int64_t node = node_of(g, i, j, k);
          if (!(g->listed[node >> 6] >> (node & 63) & 1)) continue;
          for (int c = 0; c < 8; c++) {
            int64_t at[3] = {i + (c >> 2), j + (c >> 1 & 1), k + (c & 1)};
            double p[3], normal[3], value = (double)g->value[node_of(g, at[0], at[1], at[2])];
            for (int x = 0; x < 3; x++) p[x] = g->origin[x] + g->cell * (double)at[x];
            if (fabs(value) > EXACT && (in_list(part, g, rank, p, normal) < 0) != (value < 0)) return 0;
          }
          rank++;
        }
  }
  return 1;
}

/* Signed distances of points (count, 3) as contacts see them. */
EXPORT void skillframe_look_up(const Part* part, int64_t count, const double* point, double* out) {
  Frame same = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
  Shape in = seen(part, NULL, &same);
  double p[3], normal[3];
  for (int64_t i = 0; i < count; i++) out[i] = distance_at(&in, 0, point + 3 * i, p, normal);
}
