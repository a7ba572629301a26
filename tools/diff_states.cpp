#include "tools/diff_states.h"

#include <algorithm>

#include <fmt/format.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

std::string tier_text(const io::Genesis& genesis) {
  std::string out = fmt::format("tier {}", io::name_of(genesis.tier));
  if (genesis.every > 1) out += fmt::format(" every {}", genesis.every);
  return out;
}

// The last step in [lowest, step] whose state both logs store.
std::optional<std::uint64_t> common_state(const StatePair& pair, std::uint64_t step,
                                          std::uint64_t lowest) {
  for (;;) {
    const auto x = pair.a->stored_step_at_or_before(step);
    const auto y = pair.b->stored_step_at_or_before(step);
    if (!x || !y) return {};
    const std::uint64_t both = std::min(*x, *y);
    if (both < lowest) return {};
    if (*x == *y) return both;
    step = both;
  }
}

std::vector<std::uint64_t> sample_steps(std::uint64_t first, std::uint64_t last, bool fine) {
  std::vector<std::uint64_t> out{first};
  const auto add = [&](std::uint64_t distance) {
    if (distance < last - first) out.push_back(first + distance);
  };
  for (std::uint64_t decade = 1; decade < last - first; decade *= 10) {
    add(decade);
    if (fine) {
      add(2 * decade);
      add(5 * decade);
    }
    if (decade > (last - first) / 10) break;
  }
  if (last != first) out.push_back(last);
  return out;
}

std::string event_text(const io::Event& event) {
  std::string out = fmt::format("{} at step {}", event.kind, event.step);
  for (const auto& [key, value] : event.items) out += fmt::format(" {}={}", key, value);
  return out;
}

std::vector<io::Event> events_in(const io::LogReader& log, std::uint64_t from, std::uint64_t to) {
  std::vector<io::Event> out;
  for (io::Event& event : log.events())
    if (event.step >= from && event.step <= to) out.push_back(std::move(event));
  return out;
}

}  // namespace

io::FrameDifference StatePair::compare(const io::FrameView& x, const io::FrameView& y) const {
  return io::compare_frames(a->genesis().schema, x, b->genesis().schema, y, match, tolerances);
}

std::optional<io::FrameDifference> StatePair::at(std::uint64_t step) const {
  if (!stores_state(*a, step) || !stores_state(*b, step)) return {};
  const auto x = a->frame(step), y = b->frame(step);
  if (!x || !y) return {};
  return compare(x->view(), y->view());
}

bool stores_state(const io::LogReader& log, std::uint64_t step) {
  const auto header = log.header(step);
  return header && header->has_state;
}

std::string why_no_state(const io::LogReader& a, const io::LogReader& b, std::uint64_t step) {
  const bool in_a = stores_state(a, step), in_b = stores_state(b, step);
  if (!in_a && !in_b)
    return fmt::format("field unknown: neither side stores the state of this step ({}; {})",
                       tier_text(a.genesis()), tier_text(b.genesis()));
  return fmt::format("field unknown: {} stores no state of this step ({})", in_a ? "b" : "a",
                     tier_text(in_a ? b.genesis() : a.genesis()));
}

io::SchemaMatch select_fields(const io::Schema& schema, io::SchemaMatch match,
                              const std::vector<std::string>& names) {
  if (names.empty()) return match;
  std::vector<bool> used(names.size(), false);
  std::erase_if(match.pairs, [&](const auto& pair) {
    const io::FieldDescriptor& field = schema.fields[pair.first];
    bool keep = false;
    for (std::size_t n = 0; n < names.size(); ++n)
      if (names[n] == field.name || names[n] == field.population) keep = used[n] = true;
    return !keep;
  });
  for (std::size_t n = 0; n < names.size(); ++n) {
    if (used[n]) continue;
    std::string known;
    for (const io::FieldDescriptor& field : schema.fields)
      known += (known.empty() ? "" : ", ") + field.name;
    throw UsageError(
        fmt::format("no field or population '{}'; the fields are {}", names[n], known));
  }
  return match;
}

StateScan scan_states(const StatePair& pair, std::uint64_t from, std::uint64_t to) {
  StateScan out;
  pair.a->for_each(from, to, [&](const io::StepHeader& header, const io::Frame* x) {
    // The other log is read in the same order, so its decoder only ever goes one step on.
    const auto y = x != nullptr ? pair.b->frame(header.step) : std::nullopt;
    if (!y) {
      ++out.without_state;
      return true;
    }
    ++out.compared;
    const io::FrameDifference found = pair.compare(x->view(), y->view());
    if (!out.first_unequal && !found.equal()) out.first_unequal = header.step;
    if (!found.within()) out.first_beyond = header.step;
    return !out.first_beyond;
  });
  return out;
}

std::vector<GrowthSample> sample_growth(const StatePair& pair, std::uint64_t first,
                                        std::uint64_t last, bool fine) {
  std::vector<GrowthSample> out;
  std::uint64_t lowest = first;
  for (const std::uint64_t target : sample_steps(first, last, fine)) {
    if (target < lowest) continue;
    const auto step = common_state(pair, target, lowest);
    if (!step) continue;
    const auto found = pair.at(*step);
    const auto header = pair.a->header(*step);
    if (!found || !header) continue;
    out.push_back({*step, header->time, found->fields});
    lowest = *step + 1;
  }
  return out;
}

Reconvergence find_reconvergence(const io::LogReader& a, const io::LogReader& b,
                                 std::uint64_t first, std::uint64_t last) {
  Reconvergence out;
  if (first == last) return out;
  a.for_each_header(first + 1, last, [&](const io::StepHeader& x) {
    const auto y = b.header(x.step);
    if (!y) return true;
    if (x.digest != y->digest) {
      out.equal_to_the_end.reset();
      return true;
    }
    ++out.equal_steps;
    if (!out.first_equal) out.first_equal = x.step;
    if (!out.equal_to_the_end) out.equal_to_the_end = x.step;
    return true;
  });
  return out;
}

std::vector<std::string> compare_tables(const io::LogReader& a, const io::LogReader& b,
                                        std::uint64_t step) {
  std::vector<std::string> out;
  const auto x = a.tables(step), y = b.tables(step);
  if (!x || !y) return out;
  const auto& tables_a = a.genesis().schema.tables;
  const auto& tables_b = b.genesis().schema.tables;
  for (std::size_t t = 0; t < tables_a.size() && t < x->rows.size(); ++t) {
    const auto same = std::find(tables_b.begin(), tables_b.end(), tables_a[t]);
    if (same == tables_b.end()) {
      out.push_back(fmt::format("event table {} is not in b in this form", tables_a[t].name));
      continue;
    }
    const auto k = static_cast<std::size_t>(same - tables_b.begin());
    if (k >= y->rows.size()) continue;
    if (x->rows[t] != y->rows[k])
      out.push_back(fmt::format("event table {} at step {}: {} rows in a, {} in b",
                                tables_a[t].name, step, x->rows[t], y->rows[k]));
    else if (x->tables[t] != y->tables[k])
      out.push_back(fmt::format("event table {} at step {}: {} rows each, values differ",
                                tables_a[t].name, step, x->rows[t]));
  }
  return out;
}

std::vector<std::string> compare_events(const io::LogReader& a, const io::LogReader& b,
                                        std::uint64_t from, std::uint64_t to) {
  const auto x = events_in(a, from, to), y = events_in(b, from, to);
  if (x == y) return {};
  const auto [p, q] = std::mismatch(x.begin(), x.end(), y.begin(), y.end());
  return {fmt::format("recorded events differ ({} in a, {} in b), first: a: {}; b: {}", x.size(),
                      y.size(), p == x.end() ? "none" : event_text(*p),
                      q == y.end() ? "none" : event_text(*q))};
}

}  // namespace varve::tools
