!> Volume, centre and moments of inertia of what a closed surface holds: sums over the pyramids from
!> a middle to each facet, whose integrals are exact.
module pd_body_surface_moments
  use pd_base_kinds, only: wp
  use pd_base_vectors, only: cross
  use pd_body_surface_surface, only: corners_of, surface_type
  implicit none (type, external)
  private
  public :: surface_moments

contains

  !> Of a density of 1; the moments are about the centre, along the axes of the surface.
  pure subroutine surface_moments(surface, volume, centre, inertia)
    type(surface_type), intent(in) :: surface   !! closed
    real(wp), intent(out) :: volume             !! [m3]
    real(wp), intent(out) :: centre(3)          !! of the volume [m]
    real(wp), intent(out) :: inertia(3, 3)      !! tensor, per density [m5]
    real(wp) :: x(3, 3), middle(3), total(3), part, spread(3, 3)
    integer :: f, i, j, k

    middle = (surface%low + surface%high)/2
    volume = 0.0_wp
    centre = 0.0_wp
    spread = 0.0_wp
    do f = 1, surface%n_facets
      x = corners_of(surface, f)
      do k = 1, 3
        x(:, k) = x(:, k) - middle
      end do
      part = dot_product(x(:, 1), cross(x(:, 2), x(:, 3)))/6
      total = sum(x, dim=2)
      volume = volume + part
      centre = centre + part*total/4
      ! the integral of x_i x_j over a tetrahedron with a corner at the middle
      do j = 1, 3
        do i = 1, 3
          spread(i, j) = spread(i, j) + part/20*(total(i)*total(j) + dot_product(x(i, :), x(j, :)))
        end do
      end do
    end do
    centre = centre/volume
    do j = 1, 3
      spread(:, j) = spread(:, j) - volume*centre*centre(j)
    end do
    inertia = -spread
    do i = 1, 3
      inertia(i, i) = inertia(i, i) + spread(1, 1) + spread(2, 2) + spread(3, 3)
    end do
    centre = centre + middle
  end subroutine surface_moments

end module pd_body_surface_moments
