"""Protocol Buffers' own JSON reader, with the messages of grasp_annotations.proto that the file uses: field names,
numbers and types as published with Intrinsic's SDK."""

import sys

from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory

from common import grip, report, rotation

F = descriptor_pb2.FieldDescriptorProto
file = descriptor_pb2.FileDescriptorProto(name="annotations.proto", package="p", syntax="proto3")


def message(name, *fields):
    made = file.message_type.add(name=name)
    for number, (field, kind) in enumerate(fields, 1):
        repeated = field.endswith("[]")
        entry = made.field.add(
            name=field.removesuffix("[]"),
            number=number,
            label=F.LABEL_REPEATED if repeated else F.LABEL_OPTIONAL,
        )
        if isinstance(kind, str):
            entry.type, entry.type_name = F.TYPE_MESSAGE, f".p.{kind}"
        else:
            entry.type = kind


message("Point", *[(axis, F.TYPE_DOUBLE) for axis in "xyz"])
message("Quaternion", *[(axis, F.TYPE_DOUBLE) for axis in "xyzw"])
message("Pose", ("position", "Point"), ("orientation", "Quaternion"))
message(
    "ManualGraspAnnotation",
    ("obj_t_ref", "Pose"),
    ("ref_t_annotation", "Pose"),
    ("num_rotations", F.TYPE_INT32),
    ("score", F.TYPE_FLOAT),
)
message("ManualGraspAnnotations", ("annotations[]", "ManualGraspAnnotation"))
pool = descriptor_pool.DescriptorPool()
pool.Add(file)
kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("p.ManualGraspAnnotations"))
with open(sys.argv[1], encoding="utf-8") as text:
    data = json_format.Parse(text.read(), kind())
grips = []
for place, entry in enumerate(data.annotations):
    assert not entry.HasField("obj_t_ref")
    p, q = entry.ref_t_annotation.position, entry.ref_t_annotation.orientation
    grips.append(grip(place, (p.x, p.y, p.z), rotation(q.w, q.x, q.y, q.z)))
report(
    grips,
    scores=[entry.score for entry in data.annotations],
    rotations=[entry.num_rotations for entry in data.annotations],
)
