# The structured part ("message") of every record of a varve log. io/FORMAT.md is normative for how
# a message is framed: one segment, no segment table, never packed.
#
# Rules of evolution: add fields at the end; never renumber, retype or change a default. A change
# that an old reader would misread raises the format version in the record header instead.
@0xdc002d06281c37c7;

using Cxx = import "/capnp/c++.capnp";
$Cxx.namespace("varve::io::schema");

struct Pair {
  key @0 :Text;
  value @1 :Text;
}

struct NamedData {
  name @0 :Text;
  content @1 :Data;
}

# 128 bits; high holds the first eight of the sixteen canonical bytes, most significant first.
struct Hash {
  high @0 :UInt64;
  low @1 :UInt64;
}

struct Field {
  name @0 :Text;
  population @1 :Text;
  type @2 :UInt8;          # 1 f64, 2 f32, 3 u64, 4 u32, 5 u8
  components @3 :UInt32;
  unit @4 :Text;
  isId @5 :Bool;
  constant @6 :Bool;
  follows @7 :Text;
}

struct Column {
  name @0 :Text;
  type @1 :UInt8;
  unit @2 :Text;
}

struct Table {
  name @0 :Text;
  columns @1 :List(Column);
}

struct Change {
  key @0 :Text;
  from @1 :Text;
  to @2 :Text;
}

struct Lineage {
  parentRunId @0 :Text;
  parentName @1 :Text;
  step @2 :UInt64;
  parentDigest @3 :Hash;
  parentChain @4 :Hash;
  chainBase @5 :Hash;
  changes @6 :List(Change);
  ancestors @7 :List(Text);
}

struct Genesis {
  engine @0 :Text;
  engineRevision @1 :UInt32;
  fields @2 :List(Field);
  tables @3 :List(Table);
  scenario @4 :Data;
  parameters @5 :List(Pair);
  models @6 :List(Pair);
  files @7 :List(NamedData);
  lineage @8 :Lineage;     # null: not a fork
  tier @9 :UInt8;          # 1 deltas, 2 digests
  every @10 :UInt32;
  keyframeSteps @11 :UInt32;
  logId @12 :Text;         # 32 hex digits; the same 16 bytes stand in every record header
  build @13 :List(Pair);
  particlesMax @14 :UInt64; # no field of this log ever holds more particles
  runId @15 :Text;         # redundant: must equal the digest of the content
}

# One blob of the body. Blobs stand in the order of the lists that name them (fields, then tables),
# each starting at the next multiple of eight bytes.
struct FieldBlob {
  checksum @0 :UInt64;     # XXH3-64 of the stored bytes
  count @1 :UInt32;        # particles
  stored @2 :UInt32;       # bytes in the body
  method @3 :UInt8;
  order @4 :UInt8;
}

struct TableBlob {
  checksum @0 :UInt64;
  rows @1 :UInt32;
  stored @2 :UInt32;
  codec @3 :UInt8;         # 0 plain, 1 zstd
}

struct Stored {
  fields @0 :List(FieldBlob);  # empty: only the digest is recorded
  tables @1 :List(TableBlob);  # empty: no table has a row
}

# Kinds Step and Keyframe. The step itself is in the record header.
struct Step {
  time @0 :Float64;
  dt @1 :Float64;
  digestHigh @2 :UInt64;
  digestLow @3 :UInt64;
  chainHigh @4 :UInt64;
  chainLow @5 :UInt64;
  stored @6 :Stored;       # null: neither state nor tables
}

# Belongs to the step of its header, and stands before that step's record.
struct Event {
  kind @0 :Text;
  items @1 :List(Pair);
}

struct Skip {
  offset @0 :UInt64;
  lastStep @1 :UInt64;     # last step that the index record there covers
}

struct Index {
  ordinal @0 :UInt64;      # 0, 1, 2 ... within the log
  firstStep @1 :UInt64;
  firstOffset @2 :UInt64;  # of the record of firstStep
  gaps @3 :List(UInt32);   # per further step: distance from the record before, in units of 8 bytes
  states @4 :Data;         # per step: 0 digest only, 1 delta, 2 keyframe
  skips @5 :List(Skip);    # earlier index records (io/FORMAT.md, "Index")
  events @6 :List(UInt64); # offsets of the event records since the index record before
  eventsBefore @7 :UInt64; # offset of the last earlier index record that names events; 0: none
}

# The log was closed here; more may follow.
struct End {
  firstStep @0 :UInt64;
  steps @1 :UInt64;        # step records so far
  lastStep @2 :UInt64;
  time @3 :Float64;
  dt @4 :Float64;
  digest @5 :Hash;         # of lastStep
  chain @6 :Hash;
  hasState @7 :Bool;
}

# Written by recovery: steps that were lost. The chain cannot be checked across it, and the next
# stored state after it is a keyframe.
struct Gap {
  from @0 :UInt64;
  to @1 :UInt64;           # inclusive; from = to + 1 where no step was lost
  what @2 :Text;
}
