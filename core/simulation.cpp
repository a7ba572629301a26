#include "core/simulation.h"

#include <type_traits>

#include "core/arithmetic.h"
#include "core/engine.h"
#include "core/initial.h"
#include "core/units.h"

namespace varve::core {

NumericalFailure::NumericalFailure(std::string criterion_, std::uint64_t step_, std::string field_,
                                   std::uint64_t id_, double value_, double limit_,
                                   std::string advice_)
    : std::runtime_error("step " + std::to_string(step_) + ": " + criterion_ + ": " + field_ +
                         " of particle " + std::to_string(id_) + ": " + number_text(value_) +
                         ", limit " + number_text(limit_) + "; " + advice_),
      criterion(std::move(criterion_)),
      field(std::move(field_)),
      advice(std::move(advice_)),
      step(step_),
      id(id_),
      value(value_),
      limit(limit_) {}

namespace {

/// Calls `make` with the dimension and precision of the scenario as types.
template <class Make>
auto dispatch(const Scenario& scenario, Make&& make) {
  require_exact_arithmetic();
  if ((scenario.has_fluid() && !with_fluid) || (scenario.has_grains() && !with_grains))
    throw ModelError(std::string(with_fluid ? "grains.rows: grains" : "fluid.present: the fluid") +
                     " were left out of this build of the engine");
  const auto with_precision = [&](auto dimension) {
    if (scenario.precision == Precision::float_) return make(dimension, FloatPrecision{});
    if (scenario.precision == Precision::mixed) return make(dimension, MixedPrecision{});
    return make(dimension, DoublePrecision{});
  };
  if (scenario.domain.dimension == 3) return with_precision(std::integral_constant<int, 3>{});
  return with_precision(std::integral_constant<int, 2>{});
}

}  // namespace

std::unique_ptr<Simulation> Simulation::create(const Scenario& resolved,
                                               const RunOptions& options) {
  return dispatch(resolved, [&](auto dimension, auto precision) -> std::unique_ptr<Simulation> {
    constexpr int D = decltype(dimension)::value;
    using P = decltype(precision);
    auto engine = std::make_unique<Engine<D, P>>(resolved, first_state<D, P>(resolved), options);
    engine->apply_scheduled();
    return engine;
  });
}

std::unique_ptr<Simulation> Simulation::restore(const Scenario& resolved,
                                                std::span<const FieldSpan> values,
                                                const RunOptions& options) {
  return dispatch(resolved, [&](auto dimension, auto precision) -> std::unique_ptr<Simulation> {
    constexpr int D = decltype(dimension)::value;
    using P = decltype(precision);
    auto engine = std::make_unique<Engine<D, P>>(resolved, State<D, P>{}, options);
    engine->set_state(values);
    engine->skip_scheduled();
    return engine;
  });
}

}  // namespace varve::core
