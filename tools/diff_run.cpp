#include "tools/diff_run.h"

#include <algorithm>

#include <fmt/format.h>

#include "io/errors.h"
#include "tools/cli.h"
#include "tools/diff_genesis.h"
#include "tools/diff_reexecute.h"
#include "tools/diff_search.h"
#include "tools/diff_states.h"
#include "tools/scratch_folder.h"
#include "tools/steps.h"

namespace varve::tools {
namespace {

void not_comparable(DiffReport& report, std::string reason) {
  report.verdict = Verdict::not_comparable;
  report.reasons.push_back(std::move(reason));
}

// Both logs, what is asked of them, and the report that grows.
class LogComparison {
 public:
  LogComparison(const io::LogReader& a, const io::LogReader& b, const DiffOptions& options)
      : a_(a), b_(b), options_(options), pair_{&a, &b, {}, options.tolerances} {}

  DiffReport run() {
    report_.a = a_.path();
    report_.b = b_.path();
    report_.tolerance_given = options_.tolerances.given();
    report_.selected = options_.fields;
    report_.genesis = compare_geneses(a_.genesis(), b_.genesis());
    report_.relation = describe_relation(a_.genesis(), b_.genesis());
    if (match_fields() && choose_range()) {
      const auto first = locate();
      report_.header_reads_a = a_.header_reads();
      report_.header_reads_b = b_.header_reads();
      if (report_.verdict != Verdict::not_comparable) judge(first);
    }
    return std::move(report_);
  }

 private:
  /// False if the states are not of one kind.
  bool match_fields() {
    pair_.match = io::match_schemas(a_.genesis().schema, b_.genesis().schema);
    // Naming fields asks for these only: what else there is on one side does not matter then.
    if (options_.fields.empty())
      for (const std::string& obstacle : pair_.match.obstacles) not_comparable(report_, obstacle);
    if (!pair_.match.widened.empty() && !report_.tolerance_given)
      not_comparable(report_, pair_.match.widened.front() +
                                  "; numbers of unequal precision compare with a tolerance only "
                                  "(--abs, --rel)");
    if (report_.verdict == Verdict::not_comparable) return false;
    for (const auto& [name, tolerance] : options_.tolerances.by_field)
      if (a_.genesis().schema.find(name) < 0)
        select_fields(a_.genesis().schema, pair_.match, {name});  // throws, naming what there is
    pair_.match = select_fields(a_.genesis().schema, pair_.match, options_.fields);
    return true;
  }

  /// False if the two logs hold no step in common.
  bool choose_range() {
    std::uint64_t from = std::max(a_.first_step(), b_.first_step());
    std::uint64_t to = std::min(a_.last_step(), b_.last_step());
    if (from > to) {
      not_comparable(report_,
                     fmt::format("no step in common: a holds {} to {}, b holds {} to {}",
                                 a_.first_step(), a_.last_step(), b_.first_step(), b_.last_step()));
      return false;
    }
    if (options_.from) from = std::max(from, parse_step(*options_.from, a_, true));
    if (options_.to) to = std::min(to, parse_step(*options_.to, a_));
    if (from > to)
      throw UsageError(fmt::format("--from and --to leave no step that both hold ({} to {})",
                                   std::max(a_.first_step(), b_.first_step()),
                                   std::min(a_.last_step(), b_.last_step())));
    report_.from = from;
    report_.to = to;
    report_.steps_compared = to - from + 1;
    if (!options_.to) note_further_steps();
    return true;
  }

  void note_further_steps() {
    const auto note = [&](char name, const io::LogReader& log) {
      if (log.last_step() > report_.to)
        report_.notes.push_back(
            fmt::format("{} goes on to step {}, without a counterpart", name, log.last_step()));
    };
    note('a', a_);
    note('b', b_);
  }

  std::optional<bool> agree(std::uint64_t step, io::Digest io::StepHeader::*digest) const {
    const auto x = a_.header(step);
    if (!x) return {};
    const auto y = b_.header(step);
    if (!y) return {};
    return (*x).*digest == (*y).*digest;
  }

  /// The last step <= `step` that both logs hold.
  std::optional<std::uint64_t> held_below(std::uint64_t step) const {
    for (;;) {
      const std::uint64_t x = a_.held_at_or_before(step), y = b_.held_at_or_before(step);
      if (x == y && x <= step) return x;
      if (std::max(x, y) > step) return {};
      step = std::min(x, y);
    }
  }

  /// First step whose state can differ, by bisection over the chains; nothing if there is none.
  std::optional<std::uint64_t> locate() {
    if (io::chain_base(a_.genesis().schema) != io::chain_base(b_.genesis().schema)) {
      // Digests of unlike schemas say nothing: every state must be looked at.
      chains_comparable_ = false;
      report_.notes.push_back("the field schemas differ, so all stored states were compared");
      return report_.from;
    }
    const HeldBelow below = [this](std::uint64_t step) { return held_below(step); };
    const ChainSearch found = search_chains(
        report_.from, report_.to,
        [&](std::uint64_t step) { return agree(step, &io::StepHeader::chain); }, below);
    if (!found.any_step) {
      not_comparable(report_, "the steps that both should hold are lost in one of them");
      return {};
    }
    if (!found.first_unequal) {
      if (const auto header = a_.header(found.last_held)) report_.chain = header->chain.hex();
      return {};
    }
    if (found.last_equal) {
      last_equal_ = found.last_equal;
      return found.first_unequal;
    }
    // The chains differ from the start: the histories before the range may, and the states not.
    const auto first = scan_first_unequal(
        found.first_held, report_.to,
        [&](std::uint64_t step) { return agree(step, &io::StepHeader::digest); }, below);
    if (first != found.first_held)
      report_.notes.push_back(fmt::format(
          "the chains differ already at step {}, where the states are equal: the histories before "
          "it differ",
          found.first_held));
    return first;
  }

  void judge(std::optional<std::uint64_t> first) {
    if (!first) {
      add_tables(report_.to);
      return;
    }
    if (report_.tolerance_given || !options_.fields.empty() || !chains_comparable_)
      judge_states(*first);
    else
      judge_bits(*first);
    if (!shown_) return;
    if (report_.verdict == Verdict::identical) return;
    report_.growth = sample_growth(pair_, *shown_, report_.to, options_.fine_growth);
    if (options_.reconverge)
      report_.reconvergence = find_reconvergence(a_, b_, *shown_, report_.to);
    add_tables(*shown_);
    for (std::string& note : compare_events(a_, b_, report_.from, report_.to))
      report_.notes.push_back(std::move(note));
  }

  void judge_bits(std::uint64_t step) {
    report_.verdict = Verdict::different;
    provide_states(step, step);
    report_.first = first_at(step, false);
    // What was executed again is one step only; growth is told from what the logs store.
    pair_.a = &a_;
    pair_.b = &b_;
    if (last_equal_ && *last_equal_ + 1 != step) report_.first->last_equal = last_equal_;
    shown_ = step;
  }

  /// Has the engine make the states of steps from..to that a log does not store, if it can.
  void provide_states(std::uint64_t from, std::uint64_t to) {
    const auto provide = [&](const io::LogReader& log, const char* name,
                             std::unique_ptr<io::LogReader>& made, const io::LogReader*& used) {
      const io::Genesis& genesis = log.genesis();
      const bool sparse = genesis.tier == io::Tier::digests || genesis.every > 1;
      if (!sparse || (from == to && stores_state(log, from))) return;
      if (!scratch_) scratch_.emplace();
      Reexecution again = reexecute(log, from, to, *scratch_, name);
      if (again.log) {
        made = std::move(again.log);
        used = made.get();
        report_.notes.push_back(
            fmt::format("{} stores no states of steps {} to {}: they were "
                        "executed again, their digests are the recorded ones",
                        name, from, to));
      } else {
        report_.notes.push_back(fmt::format("{}: {}", name, again.problem));
      }
    };
    provide(a_, "a", made_a_, pair_.a);
    provide(b_, "b", made_b_, pair_.b);
  }

  void judge_states(std::uint64_t start) {
    provide_states(start, report_.to);
    const StateScan scan = scan_states(pair_, start, report_.to);
    report_.steps_compared = start - report_.from + scan.compared;
    if (scan.without_state != 0)
      report_.notes.push_back(fmt::format(
          "{} steps store no state on one side and were not compared", scan.without_state));
    if (scan.compared == 0) {
      not_comparable(report_, "no step from the first difference on has its state in both logs");
      return;
    }
    shown_ = scan.first_unequal;
    if (scan.first_beyond) {
      report_.verdict = Verdict::different;
      report_.first = first_at(*scan.first_beyond, true);
      if (scan.first_unequal != scan.first_beyond)
        report_.first_bitwise = first_at(*scan.first_unequal, false);
    } else if (scan.first_unequal) {
      report_.verdict = Verdict::within_tolerance;
      report_.first = first_at(*scan.first_unequal, false);
    }
  }

  /// The difference at a step; the last call's fields are those of the report.
  FirstDifference first_at(std::uint64_t step, bool beyond) {
    FirstDifference out;
    out.step = step;
    if (const auto header = a_.header(step)) out.time = header->time;
    if (const auto states = pair_.at(step)) {
      describe_first(*states, beyond, out);
      report_.fields = states->fields;
      if (out.field.empty()) out.why_no_field = "though no field of the state differs";
    } else {
      out.why_no_field = why_no_state(*pair_.a, *pair_.b, step);
    }
    return out;
  }

  void add_tables(std::uint64_t step) {
    const std::uint64_t begin = options_.all_tables ? report_.from : step;
    const std::uint64_t end = options_.all_tables ? report_.to : step;
    for (std::uint64_t at = begin; at <= end; ++at) {
      if (!agree(at, &io::StepHeader::digest)) {  // lost: on to the next that both hold
        const auto held = held_above(at, end, [this](std::uint64_t s) { return held_below(s); });
        if (!held) return;
        at = *held;
      }
      const std::vector<std::string> found = compare_tables(a_, b_, at);
      report_.notes.insert(report_.notes.end(), found.begin(), found.end());
      if (!found.empty() || at == end) return;
    }
  }

  const io::LogReader& a_;
  const io::LogReader& b_;
  const DiffOptions& options_;
  StatePair pair_;
  DiffReport report_;
  std::optional<ScratchFolder> scratch_;
  std::unique_ptr<io::LogReader> made_a_, made_b_;  ///< re-executed states
  bool chains_comparable_ = true;
  std::optional<std::uint64_t> last_equal_;
  std::optional<std::uint64_t> shown_;  ///< first step with any difference
};

}  // namespace

void require_whole(const io::LogReader& log) {
  if (log.completeness() == io::Completeness::damaged)
    throw io::LogError(io::ErrorKind::damaged, log.path(),
                       "damaged; 'varve verify' says where, 'varve recover' saves what is whole");
}

std::unique_ptr<io::LogReader> open_whole(const std::string& path) {
  auto log = io::LogReader::open(path);
  require_whole(*log);
  if (log->completeness() == io::Completeness::torn)
    warn(fmt::format("{}: torn: {} bytes beyond step {} are left out", path, log->torn_bytes(),
                     log->last_step()));
  return log;
}

DiffReport compare_logs(const io::LogReader& a, const io::LogReader& b,
                        const DiffOptions& options) {
  DiffReport report = LogComparison(a, b, options).run();
  // Rot is only noticed where it is read; what was found beside it is not to be relied on.
  require_whole(a);
  require_whole(b);
  return report;
}

}  // namespace varve::tools
