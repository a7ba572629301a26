// Finding the first step at which two histories part.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

namespace varve::tools {

/// Whether both sides agree at a step; nothing where one of them does not hold it.
using EqualAt = std::function<std::optional<bool>(std::uint64_t step)>;

struct ChainSearch {
  bool any_step = false;  ///< both sides hold at least one step of the range
  std::uint64_t first_held = 0, last_held = 0;
  std::optional<std::uint64_t> last_equal;  ///< last step known equal before `first_unequal`
  std::optional<std::uint64_t> first_unequal;
};

/// Bisects [from, to] for the first step whose chains differ. Chains never agree again once they
/// differ, so at most log2(to - from) + 3 steps are looked at where no steps are missing.
ChainSearch search_chains(std::uint64_t from, std::uint64_t to, const EqualAt& chains_equal);

/// First step in [from, to] where `equal` is false, looking at every one of them.
std::optional<std::uint64_t> scan_first_unequal(std::uint64_t from, std::uint64_t to,
                                                const EqualAt& equal);

}  // namespace varve::tools
