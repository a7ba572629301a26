#include "core/parameters.h"

#include <algorithm>
#include <limits>

namespace varve::core {
namespace {

using Names = std::span<const std::string_view>;
using namespace std::string_view_literals;

// Each list is in its enum's order; a shorter one leaves out what the key does not allow.
constexpr std::array precisions{"double"sv, "float"sv, "mixed"sv};
constexpr std::array models{"standard"sv, "study"sv};
constexpr std::array fidelities{"draft"sv, "standard"sv, "fine"sv, "reference"sv};
constexpr std::array boundaries{"no_slip"sv, "free_slip"sv, "periodic"sv, "free"sv};
constexpr std::array pressure_forms{"auto"sv, "excess"sv, "full"sv};
constexpr std::array equations_of_state{"linear"sv, "tait"sv};
constexpr std::array pressure_forces{"conjugate"sv, "averaged"sv};
constexpr std::array porosities{"kernel"sv, "conservative"sv};
constexpr std::array coupling_modes{"two_way"sv, "one_way"sv, "off"sv};
constexpr std::array drags{"stokes"sv, "schiller_naumann"sv, "dallavalle_di_felice"sv, "gidaspow"sv,
                           "cylinder"sv};
constexpr std::array kernels{"wendland_c2"sv, "cubic"sv, "quintic"sv};
constexpr std::array shapes{"box"sv, "pipe"sv};
constexpr std::array flows{"rest"sv, "uniform"sv, "shear"sv, "taylor_green"sv};
constexpr std::array motions{"free"sv, "frozen"sv, "driven"sv};
constexpr std::array arrangements{"square"sv, "hexagonal"sv, "random"sv, "list"sv};
constexpr std::array contact_laws{"linear"sv, "hertz"sv};
constexpr std::array tiers{"deltas"sv, "digests"sv};

constexpr Dimension pure{}, length{0, 1, 0}, time_dimension{0, 0, 1}, speed{0, 1, -1},
    acceleration{0, 1, -2}, density{1, -3, 0}, viscosity{1, -1, -1}, stiffness{1, 0, -2},
    modulus{1, -1, -2}, frequency{0, 0, -1};

constexpr double huge = 1e12;        // of lengths, times and the like: far beyond any scene
constexpr double counts = 1e9;       // of whole numbers
constexpr double seeds = 0x1p53;     // whole numbers that a double holds
constexpr double steps_max = 1e15;

/// What a real key accepts.
struct Range {
  double lowest, highest;
  bool lowest_open = false;
};
constexpr Range positive{0, huge, true};
constexpr Range any{-huge, huge};

enum Automatic : bool { given = false, automatic_ok = true };

Parameter real(std::string_view key, std::string_view unit, Dimension dimension, Range range,
               Automatic may_be_automatic, Change change, Parameter::Real access,
               std::string_view meaning) {
  return {key,    unit,  dimension, meaning, range.lowest, range.highest, range.lowest_open,
          may_be_automatic, change, {},       access};
}
Parameter whole(std::string_view key, Range range, Change change, Parameter::Integer access,
                std::string_view meaning) {
  return {key, "", pure, meaning, range.lowest, range.highest, false, false, change, {}, access};
}
Parameter flag(std::string_view key, Change change, Parameter::Flag access,
               std::string_view meaning) {
  return {key, "", pure, meaning, 0, 1, false, false, change, {}, access};
}
Parameter text(std::string_view key, Change change, Parameter::Text access,
               std::string_view meaning) {
  return {key, "", pure, meaning, 0, 0, false, false, change, {}, access};
}
Parameter choice(std::string_view key, Names names, Change change, Parameter::Choice access,
                 std::string_view meaning) {
  return {key, "", pure, meaning, 0, 0, false, false, change, names, access};
}

// Access to a member, as the plain function pointers that the table holds.
#define VARVE_MEMBER(type, member) +[](Scenario & s) -> type& { return s.member; }
#define VARVE_REAL(member) VARVE_MEMBER(double, member)
#define VARVE_WHOLE(member) VARVE_MEMBER(std::int64_t, member)
#define VARVE_FLAG(member) VARVE_MEMBER(bool, member)
#define VARVE_TEXT(member) VARVE_MEMBER(std::string, member)
#define VARVE_CHOICE(member)                                                     \
  Parameter::Choice {                                                            \
    +[](const Scenario& s) { return static_cast<int>(s.member); },               \
        +[](Scenario& s, int v) { s.member = static_cast<decltype(s.member)>(v); } \
  }

void add_scene(std::vector<Parameter>& table) {
  const auto add = [&table](Parameter parameter) { table.push_back(parameter); };
  add(text("scenario.title", Change::never, VARVE_TEXT(title), "one line for people"));
  add(choice("scenario.precision", precisions, Change::never, VARVE_CHOICE(precision),
             "scalar type of the state; mixed: single, with positions in double"));
  add(choice("scenario.model", models, Change::never, VARVE_CHOICE(model),
             "defaults of the models; study: those of the study that varve reproduces"));
  add(choice("scenario.fidelity", fidelities, Change::never, VARVE_CHOICE(fidelity),
             "defaults of resolution, sound speed, time step and precision: speed for accuracy"));

  add(whole("domain.dimension", {2, 3}, Change::never, VARVE_WHOLE(domain.dimension),
            "2: discs, everything per metre of depth; 3: spheres"));
  add(choice("domain.shape", shapes, Change::never, VARVE_CHOICE(domain.shape),
             "pipe: an upright round pipe, as wide as domain.width; 3D only"));
  add(real("domain.width", "m", length, positive, given, Change::geometry, VARVE_REAL(domain.width),
           "extent in x; diameter of a pipe"));
  add(real("domain.height", "m", length, positive, given, Change::never, VARVE_REAL(domain.height),
           "extent in y, from the bottom at y = 0"));
  add(real("domain.depth", "m", length, positive, automatic_ok, Change::never,
           VARVE_REAL(domain.depth),
           "extent in z, from the front at z = 0; 3D only, auto in 2D and for a pipe"));
  add(real("domain.left", "m", length, any, given, Change::never, VARVE_REAL(domain.left),
           "x of the left side; moves when the width changes"));
  add(choice("domain.sides", Names(boundaries).first(3), Change::never, VARVE_CHOICE(domain.sides),
             "left and right; the wall of a pipe"));
  add(choice("domain.bottom", Names(boundaries).first(3), Change::never,
             VARVE_CHOICE(domain.bottom), "periodic only together with the top"));
  add(choice("domain.top", boundaries, Change::never, VARVE_CHOICE(domain.top),
             "free: a free surface, no lid"));
  add(choice("domain.faces", Names(boundaries).first(3), Change::never, VARVE_CHOICE(domain.faces),
             "front and back, in 3D; a pipe has none"));
  add(real("domain.lid_speed", "m/s", speed, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(domain.lid_speed), "of a no-slip top along x: a moving lid"));
  add(real("domain.floor_speed", "m/s", speed, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(domain.floor_speed), "of a no-slip bottom along x"));

  add(real("gravity.magnitude", "m/s2", acceleration, {0, 1e6}, given, Change::parameter,
           VARVE_REAL(gravity.magnitude), "0: none"));
  add(real("gravity.tilt", "rad", pure, {-3.2, 3.2}, given, Change::parameter,
           VARVE_REAL(gravity.tilt), "direction, from straight down towards +x"));
}

void add_fluid(std::vector<Parameter>& table) {
  const auto add = [&table](Parameter parameter) { table.push_back(parameter); };
  add(flag("fluid.present", Change::never, VARVE_FLAG(fluid.present),
           "off: a scene of grains only, no fluid is built, run or recorded"));
  add(real("fluid.density", "kg/m3", density, {0, 1e6, true}, given, Change::never,
           VARVE_REAL(fluid.density), "at rest"));
  add(real("fluid.viscosity", "Pa s", viscosity, {0, 1e6, true}, given, Change::parameter,
           VARVE_REAL(fluid.viscosity), "dynamic"));
  add(real("fluid.spacing", "m", length, positive, automatic_ok, Change::never,
           VARVE_REAL(fluid.spacing),
           "of the first lattice of fluid particles; auto: by fluid.resolution"));
  add(real("fluid.resolution", "", pure, {0.5, 100}, given, Change::never,
           VARVE_REAL(fluid.resolution),
           "of an automatic spacing: at least so many to a grain diameter, or 16 times as many to "
           "the domain's least extent where there are no grains"));
  add(real("fluid.level", "m", length, positive, automatic_ok, Change::never,
           VARVE_REAL(fluid.level), "filling height above the bottom; auto: the domain's height"));
  add(real("fluid.width", "m", length, positive, automatic_ok, Change::never,
           VARVE_REAL(fluid.width),
           "filled at the start, from the left wall: a column behind a dam; auto: all of it"));
  add(choice("fluid.kernel", kernels, Change::never, VARVE_CHOICE(fluid.kernel),
             "smoothing kernel; cubic lets particles pair up"));
  add(real("fluid.smoothing_ratio", "", pure, {0.8, 4}, given, Change::never,
           VARVE_REAL(fluid.smoothing_ratio), "smoothing length over spacing"));
  add(real("fluid.sound_speed", "m/s", speed, {0, 1e6, true}, automatic_ok, Change::never,
           VARVE_REAL(fluid.sound_speed),
           "numerical; auto: 10 x the fluid's and 20 x the grains' largest expected speed"));
  add(real("fluid.sound_speed_factor", "", pure, {0.1, 100}, given, Change::never,
           VARVE_REAL(fluid.sound_speed_factor), "of the automatic sound speed"));
  add(choice("fluid.pressure", pressure_forms, Change::never, VARVE_CHOICE(fluid.pressure),
             "excess: hydrostatics taken out analytically; full: needed under a free surface"));
  add(choice("fluid.equation_of_state", equations_of_state, Change::never,
             VARVE_CHOICE(fluid.equation_of_state),
             "linear: P = c0^2 (rho - rho0); tait: exponent 7, stiffer when compressed"));
  add(real("fluid.artificial_alpha", "", pure, {0, 4}, given, Change::never,
           VARVE_REAL(fluid.artificial_alpha),
           "artificial viscosity (Monaghan), linear term; acts like nu = alpha c0 h / 8 (2D)"));
  add(real("fluid.artificial_beta", "", pure, {0, 10}, given, Change::never,
           VARVE_REAL(fluid.artificial_beta),
           "artificial viscosity (Monaghan), quadratic term"));
  add(real("fluid.density_diffusion", "", pure, {0, 1}, given, Change::never,
           VARVE_REAL(fluid.density_diffusion), "delta of delta-SPH"));
  add(real("fluid.shifting", "", pure, {0, 4}, given, Change::never, VARVE_REAL(fluid.shifting),
           "strength of particle shifting, with corrected gradients; 1 suits; not with a free "
           "surface or two-way coupling"));
  add(real("fluid.jitter", "", pure, {0, 0.5}, given, Change::never, VARVE_REAL(fluid.jitter),
           "largest displacement from the lattice, over spacing"));
  add(whole("fluid.seed", {0, seeds}, Change::never, VARVE_WHOLE(fluid.seed), "of the jitter"));
  add(real("fluid.body_force_x", "m/s2", acceleration, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(fluid.body_force_x), "acceleration of the fluid alone, along x"));
  add(real("fluid.body_force_y", "m/s2", acceleration, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(fluid.body_force_y), "acceleration of the fluid alone, along y"));
  add(real("fluid.body_force_z", "m/s2", acceleration, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(fluid.body_force_z), "acceleration of the fluid alone, along z; 3D only"));
  add(choice("fluid.initial", flows, Change::never, VARVE_CHOICE(fluid.initial),
             "flow at the start; shear: along x, from 0 at the bottom to full speed at the top; "
             "taylor_green: vortices, one wave across the domain"));
  add(real("fluid.initial_speed", "m/s", speed, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(fluid.initial_speed), "amplitude of the flow at the start"));
}

void add_grains(std::vector<Parameter>& table) {
  const auto add = [&table](Parameter parameter) { table.push_back(parameter); };
  add(choice("grains.arrangement", arrangements, Change::never, VARVE_CHOICE(grains.arrangement),
             "array of rows and columns, random packing of grains.count, or the list in a file"));
  add(text("grains.file", Change::never, VARVE_TEXT(grains.file),
           "list of grains, beside the scenario: columns x,y,z,species,vx,vy,vz,wx,wy,wz"));
  add(whole("grains.count", {0, counts}, Change::never, VARVE_WHOLE(grains.count),
            "grains of a random packing"));
  add(real("grains.from_y", "m", length, any, automatic_ok, Change::never,
           VARVE_REAL(grains.from_y), "lower end of a random packing; auto: the bottom"));
  add(real("grains.to_y", "m", length, any, automatic_ok, Change::never, VARVE_REAL(grains.to_y),
           "upper end of a random packing; auto: the top"));
  add(whole("grains.rows", {0, counts}, Change::never, VARVE_WHOLE(grains.rows),
            "of the array, upwards; 0: no grains"));
  add(whole("grains.columns", {0, counts}, Change::never, VARVE_WHOLE(grains.columns),
            "of the array, along x; 0: no grains"));
  add(whole("grains.layers", {1, counts}, Change::never, VARVE_WHOLE(grains.layers),
            "of the array, along z; 1 in 2D"));
  add(real("grains.diameter", "m", length, positive, given, Change::never,
           VARVE_REAL(grains.diameter), "of a disc or sphere"));
  add(real("grains.density", "kg/m3", density, {0, 1e9, true}, given, Change::never,
           VARVE_REAL(grains.density), "of the solid"));
  add(real("grains.share", "", pure, {0, 1e9}, given, Change::never, VARVE_REAL(grains.share),
           "relative number of these grains where there are other species, [species.NAME]"));
  add(real("grains.centre_x", "m", length, any, automatic_ok, Change::never,
           VARVE_REAL(grains.centre_x), "x of the array's middle; auto: the domain's middle"));
  add(real("grains.lowest_y", "m", length, any, automatic_ok, Change::never,
           VARVE_REAL(grains.lowest_y),
           "y of the lowest row's centres; auto: the array is centred"));
  add(real("grains.centre_z", "m", length, any, automatic_ok, Change::never,
           VARVE_REAL(grains.centre_z), "z of the array's middle; 3D only, auto: the domain's"));
  add(real("grains.gap", "", pure, {0, 1e3}, given, Change::never, VARVE_REAL(grains.gap),
           "free space between neighbours, over diameter"));
  add(real("grains.jitter", "", pure, {0, 0.5}, given, Change::never, VARVE_REAL(grains.jitter),
           "largest displacement from the array along each axis, over diameter"));
  add(whole("grains.seed", {0, seeds}, Change::never, VARVE_WHOLE(grains.seed),
            "of jitter, random packing and species"));
  add(real("grains.velocity_x", "m/s", speed, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(grains.velocity_x), "at the start"));
  add(real("grains.velocity_y", "m/s", speed, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(grains.velocity_y), "at the start"));
  add(real("grains.velocity_z", "m/s", speed, {-1e6, 1e6}, given, Change::never,
           VARVE_REAL(grains.velocity_z), "at the start; 3D only"));
  add(real("grains.spin_x", "1/s", frequency, {-1e9, 1e9}, given, Change::never,
           VARVE_REAL(grains.spin_x), "in radians, at the start; 3D only"));
  add(real("grains.spin_y", "1/s", frequency, {-1e9, 1e9}, given, Change::never,
           VARVE_REAL(grains.spin_y), "in radians, at the start; 3D only"));
  add(real("grains.spin_z", "1/s", frequency, {-1e9, 1e9}, given, Change::never,
           VARVE_REAL(grains.spin_z), "in radians, at the start"));
  add(choice("grains.motion", motions, Change::never, VARVE_CHOICE(grains.motion),
             "frozen: held in place, felt by the fluid; driven: at their first velocity until "
             "touched"));
}

void add_contact(std::vector<Parameter>& table) {
  const auto add = [&table](Parameter parameter) { table.push_back(parameter); };
  add(choice("contact.law", contact_laws, Change::never, VARVE_CHOICE(contact.law),
             "linear spring, or Hertz and Mindlin's with Tsuji's damping (3D)"));
  add(real("contact.time", "s", time_dimension, {0, 1e3, true}, given, Change::never,
           VARVE_REAL(contact.time),
           "duration of an undamped contact with a wall; used where stiffness is auto"));
  add(real("contact.stiffness", "N/m", stiffness, {0, 1e15, true}, automatic_ok, Change::parameter,
           VARVE_REAL(contact.stiffness),
           "normal spring, per metre of depth in 2D; auto: from contact.time"));
  add(real("contact.damping", "", pure, {0, 2}, given, Change::parameter,
           VARVE_REAL(contact.damping), "alpha in eta = alpha sqrt(m_eff k); 2 is critical"));
  add(real("contact.restitution", "", pure, {0.02, 1}, automatic_ok, Change::never,
           VARVE_REAL(contact.restitution), "dry; if given it sets contact.damping"));
  add(real("contact.youngs_modulus", "Pa", modulus, {0, 1e15, true}, automatic_ok,
           Change::parameter, VARVE_REAL(contact.youngs_modulus),
           "of the grains, for Hertz's law; walls are rigid"));
  add(real("contact.poisson_ratio", "", pure, {0, 0.5}, given, Change::never,
           VARVE_REAL(contact.poisson_ratio), "of the grains, for Hertz's law"));
  add(real("contact.friction", "", pure, {0, 1e6}, given, Change::parameter,
           VARVE_REAL(contact.friction), "Coulomb coefficient"));
  add(flag("contact.rotation", Change::never, VARVE_FLAG(contact.rotation),
           "off: no friction, no spin; nothing of either is stored"));
  add(real("contact.tangential_ratio", "", pure, {0, 1}, automatic_ok, Change::never,
           VARVE_REAL(contact.tangential_ratio),
           "tangential over normal stiffness; auto: 1/3 for discs, 2/7 for spheres"));
  add(real("contact.rolling_friction", "", pure, {0, 10}, given, Change::never,
           VARVE_REAL(contact.rolling_friction),
           "largest rolling moment over effective radius x normal force; 0: none is stored"));
  add(flag("contact.lubrication", Change::never, VARVE_FLAG(contact.lubrication),
           "viscous film between grains, and grains and walls, that nearly touch"));
  add(real("contact.lubrication_range", "", pure, {0, 2, true}, given, Change::never,
           VARVE_REAL(contact.lubrication_range),
           "gap within which the film acts, over the effective radius"));
  add(real("contact.lubrication_gap", "", pure, {1e-6, 1}, given, Change::never,
           VARVE_REAL(contact.lubrication_gap),
           "gap below which the film grows no stronger (roughness), over the effective radius"));
}

void add_coupling(std::vector<Parameter>& table) {
  const auto add = [&table](Parameter parameter) { table.push_back(parameter); };
  add(choice("coupling.mode", coupling_modes, Change::never, VARVE_CHOICE(coupling.mode),
             "one_way: grains feel the fluid, the fluid does not feel them"));
  add(real("coupling.length", "m", length, positive, automatic_ok, Change::never,
           VARVE_REAL(coupling.length),
           "smoothing length between fluid and grains; auto: a grain diameter"));
  add(choice("coupling.drag", drags, Change::never, VARVE_CHOICE(coupling.drag), "drag law"));
  add(choice("coupling.porosity", porosities, Change::never, VARVE_CHOICE(coupling.porosity),
             "conservative: a grain's volume is never lost through walls"));
  add(choice("coupling.pressure_force", pressure_forces, Change::never,
             VARVE_CHOICE(coupling.pressure_force),
             "conjugate: from the work that grains do on the fluid's density, stable in dense "
             "heaps; averaged: mean of -grad p around a grain, as the study has it"));
  add(real("coupling.porosity_floor", "", pure, {0, 1, true}, automatic_ok, Change::never,
           VARVE_REAL(coupling.porosity_floor),
           "least porosity used in density and drag; auto: 0.30 in 2D, 0.25 in 3D"));
  add(flag("coupling.exclude_own_volume", Change::never, VARVE_FLAG(coupling.exclude_own_volume),
           "the porosity a grain feels leaves its own volume out"));
  add(real("coupling.added_mass", "", pure, {0, 2}, given, Change::never,
           VARVE_REAL(coupling.added_mass),
           "fluid that a grain has to accelerate, over the displaced; 0.5 sphere, 1 disc; 0: off"));
  add(flag("coupling.self_disturbance", Change::never, VARVE_FLAG(coupling.self_disturbance),
           "corrects the slip for the flow a grain itself sets up (3D; slow, dilute, off walls)"));

  add(real("time.cfl", "", pure, {0, 1, true}, given, Change::never, VARVE_REAL(time.cfl),
           "dt over smoothing length / sound speed"));
  add(real("time.dt", "s", time_dimension, {0, 1e6, true}, automatic_ok, Change::parameter,
           VARVE_REAL(time.dt), "step, fixed for the run; auto: the largest the criteria allow"));
  add(whole("time.substeps", {0, 1e6}, Change::never, VARVE_WHOLE(time.substeps),
            "grain sub-steps per step; 0: thirty to a contact"));
  add(real("time.until", "s", time_dimension, {0, huge}, automatic_ok, Change::outputs,
           VARVE_REAL(time.until), "end of the run: the first step not before it"));
  add(whole("time.steps", {0, steps_max}, Change::outputs, VARVE_WHOLE(time.steps),
            "length of the run in steps; 0: time.until"));

  add(real("guards.density_deviation", "", pure, {0, 1e3, true}, given, Change::never,
           VARVE_REAL(guards.density_deviation), "the run stops above this |rho / rho0 - 1|"));
  add(real("guards.overlap", "", pure, {0, 1, true}, given, Change::never,
           VARVE_REAL(guards.overlap), "the run stops above this overlap, over diameter"));
  add(real("guards.speed", "", pure, {0, 1e6, true}, given, Change::never,
           VARVE_REAL(guards.speed), "the run stops above this speed, over the sound speed"));

  add(choice("record.tier", tiers, Change::outputs, VARVE_CHOICE(record.tier),
             "deltas: every recorded state decodes; digests: states by re-execution"));
  add(whole("record.every", {1, 1e6}, Change::outputs, VARVE_WHOLE(record.every),
            "states of every k-th step; digests of all"));
  add(whole("record.keyframe_steps", {1, 1e6}, Change::outputs, VARVE_WHOLE(record.keyframe_steps),
            "a complete state at least this often"));
  add(flag("record.stage_digests", Change::outputs, VARVE_FLAG(record.stage_digests),
           "record a digest of every stage of every step, to locate a difference inside a step"));
}

#undef VARVE_MEMBER
#undef VARVE_REAL
#undef VARVE_WHOLE
#undef VARVE_FLAG
#undef VARVE_TEXT
#undef VARVE_CHOICE

std::vector<Parameter> make_table() {
  std::vector<Parameter> table;
  add_scene(table);
  add_fluid(table);
  add_grains(table);
  add_contact(table);
  add_coupling(table);
  return table;
}

}  // namespace

std::span<const Parameter> parameters() {
  static const std::vector<Parameter> table = make_table();
  return table;
}

const Parameter* find_parameter(std::string_view key) {
  for (const Parameter& parameter : parameters())
    if (parameter.key == key) return &parameter;
  return nullptr;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  // Optimal string alignment: insertions, deletions, substitutions, swaps of neighbours.
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before.swap(last);
    last.swap(row);
  }
  return last[b.size()];
}

std::string_view nearest_key(std::string_view key) {
  constexpr std::size_t key_max = 64;
  if (key.empty() || key.size() > key_max) return "";
  const auto leaf_of = [](std::string_view k) { return k.substr(k.find('.') + 1); };
  const std::string_view leaf = leaf_of(key);
  std::string_view nearest;
  std::size_t least = std::max<std::size_t>(2, key.size() / 4) + 1;
  for (const Parameter& parameter : parameters()) {
    std::size_t distance = edit_distance(key, parameter.key);
    // The right name in the wrong section is a near miss, whatever the sections are called.
    if (leaf_of(parameter.key) == leaf) distance = std::min<std::size_t>(distance, 2);
    if (distance < least) {
      least = distance;
      nearest = parameter.key;
    }
  }
  return nearest;
}

}  // namespace varve::core
