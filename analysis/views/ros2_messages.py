"""Contains the definitions of the ROS 2 messages in an MCAP file.

An MCAP file stores these definitions together with the messages. The definitions are
those of ROS 2 Jazzy. They omit comments, default values, and unused constants.
"""

from __future__ import annotations

import re

#: Fields of each message. The keys are the names of the messages without ``msg/``.
DEFINITIONS = {
    "builtin_interfaces/Duration": """\
int32 sec
uint32 nanosec
""",
    "builtin_interfaces/Time": """\
int32 sec
uint32 nanosec
""",
    "geometry_msgs/Point": """\
float64 x
float64 y
float64 z
""",
    "geometry_msgs/PointStamped": """\
std_msgs/Header header
geometry_msgs/Point point
""",
    "geometry_msgs/Pose": """\
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
""",
    "geometry_msgs/PoseStamped": """\
std_msgs/Header header
geometry_msgs/Pose pose
""",
    "geometry_msgs/Quaternion": """\
float64 x
float64 y
float64 z
float64 w
""",
    "geometry_msgs/Transform": """\
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
""",
    "geometry_msgs/TransformStamped": """\
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
""",
    "geometry_msgs/Twist": """\
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
""",
    "geometry_msgs/TwistStamped": """\
std_msgs/Header header
geometry_msgs/Twist twist
""",
    "geometry_msgs/Vector3": """\
float64 x
float64 y
float64 z
""",
    "sensor_msgs/CompressedImage": """\
std_msgs/Header header
string format
uint8[] data
""",
    "sensor_msgs/Range": """\
uint8 ULTRASOUND=0
uint8 INFRARED=1
std_msgs/Header header
uint8 radiation_type
float32 field_of_view
float32 min_range
float32 max_range
float32 range
float32 variance
""",
    "std_msgs/ColorRGBA": """\
float32 r
float32 g
float32 b
float32 a
""",
    "std_msgs/Float64": """\
float64 data
""",
    "std_msgs/Header": """\
builtin_interfaces/Time stamp
string frame_id
""",
    "tf2_msgs/TFMessage": """\
geometry_msgs/TransformStamped[] transforms
""",
    "visualization_msgs/Marker": """\
int32 CUBE=1
int32 LINE_LIST=5
int32 ADD=0
std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string texture_resource
sensor_msgs/CompressedImage texture
visualization_msgs/UVCoordinate[] uv_coordinates
string text
string mesh_resource
visualization_msgs/MeshFile mesh_file
bool mesh_use_embedded_materials
""",
    "visualization_msgs/MarkerArray": """\
visualization_msgs/Marker[] markers
""",
    "visualization_msgs/MeshFile": """\
string filename
uint8[] data
""",
    "visualization_msgs/UVCoordinate": """\
float32 u
float32 v
""",
}
_RULE = "=" * 80


def message_definition(name: str) -> str:
    """Returns the definition of a message and of all its parts.

    The text has the format of the bag files of ROS 2.

    Args:
        name: Name of the message, such as ``geometry_msgs/PoseStamped``.

    Returns:
        Fields of the message, followed by the definition of each part. A line of equal
        signs and the name of the part precede each definition.
    """
    needed, waiting = [], [name]
    while waiting:
        part = waiting.pop(0)
        if part not in needed:
            needed.append(part)
            waiting += re.findall(r"^(\w+/\w+)", DEFINITIONS[part], re.MULTILINE)
    rest = [f"{_RULE}\nMSG: {part}\n{DEFINITIONS[part]}" for part in needed[1:]]
    return "".join([DEFINITIONS[name], *rest])
