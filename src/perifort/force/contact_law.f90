!> What two points in contact do (doc/theory.md, 17): from which distance on they push, along which
!> line or normal, how stiff, and with which losses.
!>
!> Along the line of centres k pushes j with the force density s c (D - d)/delta V_k, c the bond
!> constant of the mean of both materials. What separates pushes less if there is a restitution e,
!> by e^2; or a dashpot acts along the line. Friction acts across it. With smoothed normals the
!> overlap of points of different bodies is that along the normal of both surfaces, shared among all
!> that are beside each other (`pd_force_normals`).
module pd_force_contact_law
  use pd_base_kinds, only: wp
  use pd_body_body, only: body_type
  use pd_family_family, only: allocate_bonds, bonds_type
  use pd_force_normals, only: frame_type, meet, normal_of_pair, patch_radius, patch_type
  use pd_force_pairs, only: pairs_type
  use pd_force_term, only: density_of, term_view_type
  use pd_law_material, only: material_type
  implicit none (type, external)
  private
  public :: contact_rule_type, contact_law_type, of_normal_force, of_friction
  public :: usual_distance, slope, reach_of_patch, loses, normal_force, constant_of
  public :: sum_pairs, find_close

  !> What a sum is of: pushing along the line or normal of a pair, or friction across it.
  integer, parameter :: of_normal_force = 1, of_friction = 2

  real(wp), parameter :: usual_distance = 0.9_wp !! of the smaller spacing
  real(wp), parameter :: slope = 0.5_wp
    !! dashpot that regularises friction, over the critical one of a pair
  integer, parameter :: at_once = 128            !! points of a chunk of a thread
  integer, parameter :: worth_threads = 1000     !! points that are near others
  !> Overlap over the spacing that is none: pairs that are where they were at the start do not touch
  !> yet, however their distance is rounded; a dashpot would act at once.
  real(wp), parameter :: nothing = 1.0e-12_wp

  !> What a `&contact` says.
  type :: contact_rule_type
    integer, allocatable :: side(:)        !! (bodies) that may meet those of other sides; 0: none
    logical :: pieces = .false.            !! points of one side meet, too, unless bonded
    real(wp) :: stiffness = 1.0_wp         !! s [-]
    real(wp) :: distance = 0.0_wp          !! D [m], 0 for the usual one
    real(wp) :: friction = 0.0_wp          !! [-]
    real(wp) :: returned = 1.0_wp          !! e^2, part of the energy that comes back [-]
    real(wp) :: damping = 0.0_wp           !! over the critical one [-]
    logical :: smoothed = .true.           !! bodies push along normals of their surfaces
  end type contact_rule_type

  !> What the pairs of a `&contact` do.
  type :: contact_law_type
    type(contact_rule_type) :: rule
    real(wp) :: delta = 1.0_wp               !! horizon, the largest one of all points [m]
    real(wp) :: ratio = 0.0_wp               !! horizon over spacing of each point; 0: one horizon
    real(wp), allocatable :: begun(:, :)     !! (n_slots, dim) where points were at the start [m]
    logical :: smoothed = .false.            !! there are bodies that push along normals
    real(wp), allocatable :: normals(:, :)   !! (3, n_slots) normals of their surfaces at the start,
                                             !! times their weights, if so
  end type contact_law_type

  !> How two points meet.
  type :: meeting_type
    type(patch_type) :: patch
    real(wp) :: n(3) = 0.0_wp        !! unit vector along which they push
    real(wp) :: begins = 0.0_wp      !! gap at which they begin to [m]
    real(wp) :: length = 0.0_wp      !! of the difference of their normals; 0: along their line [-]
  end type meeting_type

contains

  !> Sum up near pairs, point by point. Along a normal n the force is minus the gradient of the
  !> energy K w (b - g)^2/2, with the gap g along it and the weight w across it. What acts on n
  !> itself is the couple of the points, which goes to their families.
  subroutine sum_pairs(law, part, pairs, frame, rates, view, force, energy, couples)
    type(contact_law_type), intent(in) :: law              !! what pairs do
    integer, intent(in) :: part                            !! `of_normal_force` or `of_friction`
    type(pairs_type), intent(in) :: pairs                  !! that are near
    type(frame_type), intent(in) :: frame                  !! normals of their points, if smoothed
    real(wp), allocatable, intent(in) :: rates(:, :)
      !! (3, points of the pairs) of the normals, if forces depend on velocities [1/s]
    type(term_view_type), intent(in) :: view               !! the instant
    real(wp), intent(inout), contiguous :: force(:, :)
      !! (n_slots, dim) force density, added to; of size 0: not wanted [N/m3]
    real(wp), intent(inout), contiguous :: energy(:)
      !! (n_slots) energy density, added to; of size 0: not wanted [J/m3]
    real(wp), allocatable, intent(inout) :: couples(:, :)
      !! (3, points of the pairs) that act on the normals, set if smoothed [N/m2]
    type(bonds_type) :: bonds
    type(meeting_type) :: meeting
    real(wp), dimension(3) :: r, v, turning, total, couple
    real(wp) :: stiffness, stored, push, critical, speed, aside, back
    integer :: i, e, k, j, dim
    logical :: ready, listed

    dim = size(view%u, 2)
    !$omp parallel if (size(pairs%slots) >= worth_threads) default(none) &
    !$omp shared(law, part, pairs, frame, rates, view, force, energy, couples, dim) &
    !$omp private(bonds, meeting, r, v, turning, total, couple, stiffness, stored, push, &
    !$omp critical, speed, aside, back, i, e, k, j, ready, listed)
    ready = .false.
    !$omp do schedule(dynamic, at_once)
    do i = 1, size(pairs%slots)
      k = pairs%slots(i)
      listed = .false.
      total = 0.0_wp
      couple = 0.0_wp
      stored = 0.0_wp
      do e = pairs%start(i), pairs%start(i + 1) - 1
        j = pairs%other(e)
        ! the layer of a boundary is moved as one
        if (view%body%layer(k) > 0 .and. view%body%layer(k) == view%body%layer(j)) cycle
        r = difference(view%body%x, k, j) + difference(view%u, k, j)
        if (law%smoothed) then
          call meet_pair(law, view, k, j, r, meeting, frame%normals(:, i), &
            & frame%normals(:, pairs%place(e)))
        else
          call meet_pair(law, view, k, j, r, meeting)
        end if
        if (.not. meeting%patch%touches) cycle
        if (law%rule%pieces) then
          if (.not. ready) call allocate_bonds(view%family, bonds)
          ready = .true.
          if (.not. listed) call view%family%bonds_of(k, bonds)
          listed = .true.
          if (any(bonds%j(:bonds%n) == j .and. bonds%intact(:bonds%n))) cycle
        end if
        associate (patch => meeting%patch, n => meeting%n, t => meeting%patch%across, &
          & overlap => meeting%begins - meeting%patch%gap)
          v = difference(view%v, k, j)
          speed = dot_product(v, n)
          v = v - speed*n
          if (meeting%length > 0.0_wp .and. allocated(rates)) then
            ! the normal turns, too: across it that is no sliding, and it changes the gap
            turning = (rates(:, i) - rates(:, pairs%place(e)))/meeting%length
            turning = turning - dot_product(turning, n)*n
            speed = speed + dot_product(turning, t)
            v = v - patch%gap*turning
          end if
          stiffness = stiffness_of(law, view, k, j)
          critical = 0.0_wp
          if (law%rule%damping > 0.0_wp .or. part == of_friction) &
            & critical = critical_damping(view, k, j, stiffness*patch%weight)
          push = normal_force(law%rule, stiffness*patch%weight, overlap, speed, critical)
          if (part == of_normal_force) then
            total = total - push*n
            stored = stored + stiffness*patch%weight*overlap**2/4
            if (meeting%length > 0.0_wp) then
              back = 1.0_wp
              if (speed > 0.0_wp) back = law%rule%returned
              back = back*stiffness*overlap**2/2*patch%slope
              total = total + back*t
              couple = couple + (push + back*patch%gap)/meeting%length*t
            end if
          else
            aside = sqrt(dot_product(v, v))
            if (.not. aside > 0.0_wp) cycle
            v = min(law%rule%friction*push, slope*critical*aside)*(v/aside)
            total = total + v
            if (meeting%length > 0.0_wp) couple = couple + patch%gap/meeting%length*v
          end if
        end associate
      end do
      if (size(force) > 0) force(k, :) = force(k, :) + total(:dim)
      if (size(energy) > 0) energy(k) = energy(k) + stored
      if (law%smoothed) couples(:, i) = couple
    end do
    !$omp end parallel
  end subroutine sum_pairs

  !> How two points meet: along the normal of their surfaces, from the gap on that they had at the
  !> start if they were near then; along the line of centres where one has none, or had none.
  pure subroutine meet_pair(law, view, k, j, r, meeting, one, other)
    type(contact_law_type), intent(in) :: law
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k, j              !! slots
    real(wp), intent(in) :: r(3)             !! from k to j [m]
    type(meeting_type), intent(out) :: meeting
    real(wp), intent(in), optional :: one(3), other(3)   !! their normals, if they are smoothed
    real(wp) :: r0(3), n0(3), spacing, length, distance
    logical :: smooth

    meeting%begins = reach_of(law, k, j, view%body)
    smooth = .false.
    if (present(one) .and. view%body%body(k) /= view%body%body(j)) then
      call normal_of_pair(one, other, meeting%n, meeting%length)
      call normal_of_pair(law%normals(:, k), law%normals(:, j), n0, length)
      smooth = meeting%length > 0.0_wp .and. length > 0.0_wp
    end if
    if (smooth) then
      spacing = (view%body%spacing(k) + view%body%spacing(j))/2
      r0 = difference(law%begun, k, j)
      if (dot_product(r0, r0) < meeting%begins**2 + patch_radius(spacing)**2) &
        & meeting%begins = min(meeting%begins, dot_product(r0, n0))
      call meet(r, meeting%n, view%body%dim, spacing, meeting%begins - nothing*spacing, &
        & meeting%patch)
    else
      meeting%length = 0.0_wp
      distance = sqrt(dot_product(r, r))
      if (distance >= meeting%begins) return
      r0 = difference(law%begun, k, j)
      meeting%begins = min(meeting%begins, sqrt(dot_product(r0, r0)))
      if (distance >= (1 - nothing)*meeting%begins) return
      meeting%patch%touches = .true.
      meeting%patch%gap = distance
      meeting%patch%weight = 1.0_wp
      ! points at one place push along the line that they began with
      if (distance > 0.0_wp) r0 = r
      meeting%n = r0/sqrt(dot_product(r0, r0))
    end if
  end subroutine meet_pair

  !> From the vector of one slot to that of another, with three components.
  pure function difference(values, k, j) result(from)
    real(wp), intent(in) :: values(:, :)   !! (n_slots, dim)
    integer, intent(in) :: k, j            !! slots
    real(wp) :: from(3)
    integer :: c

    from = 0.0_wp
    do c = 1, size(values, 2)
      from(c) = values(j, c) - values(k, c)
    end do
  end function difference

  !> Which points have one of another body so close that they may touch along a normal.
  subroutine find_close(law, pairs, view, may_touch)
    type(contact_law_type), intent(in) :: law          !! what pairs do
    type(pairs_type), intent(in) :: pairs              !! that are near
    type(term_view_type), intent(in) :: view           !! the instant
    logical, allocatable, intent(out) :: may_touch(:)  !! (points of the pairs)
    real(wp) :: r(3), reach
    integer :: i, e, k, j

    allocate (may_touch(size(pairs%slots)))
    !$omp parallel do if (size(pairs%slots) >= worth_threads) default(none) &
    !$omp schedule(dynamic, at_once) shared(law, pairs, view, may_touch) &
    !$omp private(r, reach, i, e, k, j)
    do i = 1, size(pairs%slots)
      k = pairs%slots(i)
      may_touch(i) = .false.
      do e = pairs%start(i), pairs%start(i + 1) - 1
        j = pairs%other(e)
        if (view%body%body(k) == view%body%body(j)) cycle
        reach = reach_of_patch(reach_of(law, k, j, view%body), (view%body%spacing(k) &
          & + view%body%spacing(j))/2)
        r = difference(view%body%x, k, j) + difference(view%u, k, j)
        may_touch(i) = dot_product(r, r) < reach**2
        if (may_touch(i)) exit
      end do
    end do
    !$omp end parallel do
  end subroutine find_close

  !> The longest distance of two points that touch along a normal [m].
  pure real(wp) function reach_of_patch(distance, spacing) result(reach)
    real(wp), intent(in) :: distance   !! at which they begin to push [m]
    real(wp), intent(in) :: spacing    !! mean of both [m]

    reach = sqrt(max(distance, patch_radius(spacing))**2 + patch_radius(spacing)**2)
  end function reach_of_patch

  !> Distance D of two points [m].
  pure real(wp) function reach_of(law, k, j, body)
    type(contact_law_type), intent(in) :: law
    integer, intent(in) :: k, j          !! slots
    type(body_type), intent(in) :: body

    reach_of = law%rule%distance
    if (.not. reach_of > 0.0_wp) &
      & reach_of = usual_distance*min(body%spacing(k), body%spacing(j))
  end function reach_of

  !> Whether forces depend on velocities.
  pure logical function loses(rule)
    type(contact_rule_type), intent(in) :: rule   !! its restitution and damping
    loses = rule%returned < 1.0_wp .or. rule%damping > 0.0_wp
  end function loses

  !> The force density by which two points push: never an attraction [N/m3].
  pure real(wp) function normal_force(rule, stiffness, overlap, speed, critical) result(push)
    type(contact_rule_type), intent(in) :: rule  !! its restitution or damping
    real(wp), intent(in) :: stiffness   !! of the pair, per volume [N/m4]
    real(wp), intent(in) :: overlap     !! of both, positive [m]
    real(wp), intent(in) :: speed       !! at which they separate [m/s]
    real(wp), intent(in) :: critical    !! damping of the pair, per volume [N s/m4]

    push = stiffness*overlap
    if (rule%returned < 1.0_wp .and. speed > 0.0_wp) push = rule%returned*push
    if (rule%damping > 0.0_wp) push = max(0.0_wp, push - rule%damping*critical*speed)
  end function normal_force

  !> Critical damping of a pair, per volume of point k: 2 sqrt(K m) with its reduced mass m
  !> [N s/m4].
  pure real(wp) function critical_damping(view, k, j, stiffness) result(critical)
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k, j         !! slots
    real(wp), intent(in) :: stiffness   !! of the pair, per volume of point k [N/m4]
    real(wp) :: one, other

    one = density_of(view, k)*view%body%volume(k)
    other = density_of(view, j)*view%body%volume(j)
    critical = 2*sqrt(stiffness*one*other/(one + other)/view%body%volume(k))
  end function critical_damping

  !> The stiffness of a pair, per volume: s c V_j/delta with the larger horizon of both [N/m4].
  pure real(wp) function stiffness_of(law, view, k, j) result(stiffness)
    type(contact_law_type), intent(in) :: law
    type(term_view_type), intent(in) :: view
    integer, intent(in) :: k, j   !! slots

    stiffness = law%rule%stiffness*(constant_of(view, k) + constant_of(view, j))/2/law%delta &
      & *view%body%volume(j)
    ! c/delta goes with the horizon to the power of -(dim + 2)
    if (law%ratio > 0.0_wp) stiffness = stiffness*(law%delta/(law%ratio &
      & *max(view%body%spacing(k), view%body%spacing(j))))**(view%body%dim + 2)
  end function stiffness_of

  !> The constant of bonds of a point's material: 18 K/(pi delta^4) in 3D [N/m6].
  pure real(wp) function constant_of(view, k) result(c)
    type(term_view_type), intent(in) :: view   !! the body
    integer, intent(in) :: k                   !! slot
    real(wp), parameter :: times(3) = [4.0_wp, 6.0_wp, 8.0_wp]

    associate (m => view%materials(view%body%material(k)))
      c = times(view%body%dim)*m%bulk_modulus*m%d
    end associate
  end function constant_of

end module pd_force_contact_law
