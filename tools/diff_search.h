// Finding the first step at which two histories part.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

namespace varve::tools {

/// Whether both sides agree at a step; nothing where one of them does not hold it.
using EqualAt = std::function<std::optional<bool>(std::uint64_t step)>;

/// The last step <= `step` that both sides hold; nothing where there is none. Asked where a step is
/// missing, so that many lost steps cost no more than one. Without it each is tried.
using HeldBelow = std::function<std::optional<std::uint64_t>(std::uint64_t step)>;

/// The first step in [from, to] that both sides hold.
std::optional<std::uint64_t> held_above(std::uint64_t from, std::uint64_t to,
                                        const HeldBelow& below);

struct ChainSearch {
  bool any_step = false;  ///< both sides hold at least one step of the range
  std::uint64_t first_held = 0, last_held = 0;
  std::optional<std::uint64_t> last_equal;  ///< last step known equal before `first_unequal`
  std::optional<std::uint64_t> first_unequal;
};

/// Bisects [from, to] for the first step whose chains differ. Chains never agree again once they
/// differ, so at most log2(to - from) + 3 steps are looked at where no steps are missing.
ChainSearch search_chains(std::uint64_t from, std::uint64_t to, const EqualAt& chains_equal,
                          const HeldBelow& below = {});

/// First step in [from, to] where `equal` is false, looking at every one of them.
std::optional<std::uint64_t> scan_first_unequal(std::uint64_t from, std::uint64_t to,
                                                const EqualAt& equal,
                                                const HeldBelow& below = {});

}  // namespace varve::tools
