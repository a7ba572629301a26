#include "tools/diff_search.h"

namespace varve::tools {
namespace {

struct Probe {
  std::uint64_t step = 0;
  bool equal = false;
};

// The held step nearest to `step` going up to `to`.
std::optional<Probe> probe_up(std::uint64_t step, std::uint64_t to, const EqualAt& equal,
                              const HeldBelow& below) {
  for (;;) {
    if (const auto answer = equal(step)) return Probe{step, *answer};
    if (step >= to) return {};
    ++step;
    if (!below) continue;
    const auto held = held_above(step, to, below);
    if (!held) return {};
    step = *held;
  }
}

std::optional<Probe> probe_down(std::uint64_t step, std::uint64_t from, const EqualAt& equal,
                                const HeldBelow& below) {
  for (;;) {
    if (const auto answer = equal(step)) return Probe{step, *answer};
    if (step <= from) return {};
    --step;
    if (!below) continue;
    const auto held = below(step);
    if (!held || *held < from) return {};
    step = *held;
  }
}

}  // namespace

std::optional<std::uint64_t> held_above(std::uint64_t from, std::uint64_t to,
                                        const HeldBelow& below) {
  auto found = below(to);
  if (!found || *found < from) return {};
  std::uint64_t low = from, high = *found;  // a held one; none below `low`
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    found = below(middle);
    if (found && *found >= from)
      high = *found;
    else
      low = middle + 1;
  }
  return high;
}

ChainSearch search_chains(std::uint64_t from, std::uint64_t to, const EqualAt& chains_equal,
                          const HeldBelow& below) {
  ChainSearch out;
  if (from > to) return out;
  const auto last = probe_down(to, from, chains_equal, below);
  if (!last) return out;
  out.any_step = true;
  out.last_held = last->step;
  // Damage may hide a step from one way of looking and not from the other: the last one is there.
  const auto first = probe_up(from, last->step, chains_equal, below).value_or(*last);
  out.first_held = first.step;
  if (last->equal) return out;
  if (!first.equal) {
    out.first_unequal = first.step;
    return out;
  }
  std::uint64_t equal = first.step, unequal = last->step;
  while (unequal - equal > 1) {
    const std::uint64_t middle = equal + (unequal - equal) / 2;
    // Lost steps around the middle: go on with the nearest ones that are there.
    auto probe = probe_up(middle, unequal - 1, chains_equal, below);
    if (!probe && middle > equal + 1)
      probe = probe_down(middle - 1, equal + 1, chains_equal, below);
    if (!probe) break;
    (probe->equal ? equal : unequal) = probe->step;
  }
  out.last_equal = equal;
  out.first_unequal = unequal;
  return out;
}

std::optional<std::uint64_t> scan_first_unequal(std::uint64_t from, std::uint64_t to,
                                                const EqualAt& equal, const HeldBelow& below) {
  for (std::uint64_t step = from; step <= to; ++step) {
    const auto probe = probe_up(step, to, equal, below);
    if (!probe) return {};
    if (!probe->equal) return probe->step;
    step = probe->step;
    if (step == to) break;
  }
  return {};
}

}  // namespace varve::tools
