"""A rospy node that republishes every std_msgs/String of /up on /down and provides /negate."""
import rospy
from std_msgs.msg import String
from std_srvs.srv import SetBool, SetBoolResponse


def negate(request):
    if not rospy.get_param("/may_negate"):
        raise rospy.ServiceException("not allowed")
    return SetBoolResponse(not request.data, "negated")


rospy.init_node("echo")
down = rospy.Publisher("/down", String, queue_size=1000)
rospy.Subscriber("/up", String, down.publish)
rospy.Service("/negate", SetBool, negate)
rospy.spin()
