// Which models a build holds: all of them. A build made with -DVARVE_WITHOUT_FLUID or
// -DVARVE_WITHOUT_GRAINS leaves one out, so that what the other costs alone can be counted
// (tests/bench/pays); the compiler then drops every stage, test and loop of it.
#pragma once

namespace varve::core {

#ifdef VARVE_WITHOUT_FLUID
inline constexpr bool with_fluid = false;
#else
inline constexpr bool with_fluid = true;
#endif
#ifdef VARVE_WITHOUT_GRAINS
inline constexpr bool with_grains = false;
#else
inline constexpr bool with_grains = true;
#endif

}  // namespace varve::core
