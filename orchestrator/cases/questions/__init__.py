"""What is most unusual, contradicts itself or has no effect in a case: asked or refused."""
