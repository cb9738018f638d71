"""Contact: joints, the forces of a contact law over a cycle, and how a law is found."""
