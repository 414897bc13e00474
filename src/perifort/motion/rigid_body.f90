!> A rigid body of a given shape (`&rigid`): what moves it and what it is to the points that touch
!> it (doc/theory.md, 17). Its pose is that of pins.
module pd_motion_rigid_body
  use pd_base_archive, only: archive_type
  use pd_base_field, only: field_type, field_values
  use pd_base_kinds, only: wp, i4
  use pd_base_text, only: to_text
  use pd_force_obstacle, only: obstacle_type
  use pd_motion_conditions, only: condition_fault, note_fault
  use pd_motion_pose, only: drift, keep_pose, momentum_of, pose_type, rotation_between, spin_of, &
    & turn_on, turned_by
  implicit none (type, external)
  private
  public :: rigid_body_type, course_type, turns_freely, turns_not, turns_as_given
  public :: place_obstacle, guide_body, kick_body, move_body, kinetic_of, keep_body, spin_now

  !> How a rigid body rotates: by the moments on it, not at all, with a given angular velocity.
  integer, parameter :: turns_freely = 1, turns_not = 2, turns_as_given = 3

  character(1), parameter :: xyz(3) = ['x', 'y', 'z']

  !> A course in time: a number, or an expression of t and its rate.
  type :: course_type
    real(wp) :: value = 0.0_wp
    type(field_type), allocatable :: values, rates
  end type course_type

  !> A rigid body. Vectors have three components whatever the dimension; those beyond it are 0.
  type :: rigid_body_type
    type(pose_type) :: pose                  !! between `move_body` and the next forces its velocity
                                             !! and momentum are those of the middle of the step
    logical :: free(3) = .true.              !! components of the centre that forces move
    integer :: turns = turns_freely
    type(course_type) :: place(3)            !! displacements of the others [m]
    type(course_type) :: spin(3)             !! where it `turns_as_given` [rad/s]
    real(wp) :: gravity(3) = 0.0_wp          !! [m/s2]
    real(wp) :: axes(3, 3) = 0.0_wp          !! its own axes as columns, undisplaced
    real(wp) :: last_load(6) = 0.0_wp        !! force and moment of contact at the last instant
    real(wp) :: last_kinetic(2) = 0.0_wp     !! kinetic energy that is given: of the centre, of
                                             !! rotation, at the last instant [J]
    logical :: accounted = .false.           !! there has been one
  end type rigid_body_type

contains

  !> The value of a course at time `t`, and its rate. A value that is not finite is noted, and 0.
  subroutine course_at(course, t, value, rate, number, key, fault)
    type(course_type), intent(in) :: course
    real(wp), intent(in) :: t                !! [s]
    real(wp), intent(out) :: value, rate
    integer, intent(in) :: number            !! of the rigid body
    character(*), intent(in) :: key
    type(condition_fault), allocatable, intent(inout) :: fault
    real(wp) :: values(1), rates(1)
    integer :: at

    value = course%value
    rate = 0.0_wp
    if (.not. allocated(course%values)) return
    call field_values(course%values, t, values, at)
    if (at == 0) call field_values(course%rates, t, rates, at)
    if (at == 0) then
      value = values(1)
      rate = rates(1)
    else
      call note_fault('rigid', number, key, 0_i4, t, fault)
    end if
  end subroutine course_at

  !> Put the surface where the body is, with the velocities given.
  pure subroutine place_obstacle(rigid, velocity, spin, obstacle)
    type(rigid_body_type), intent(in) :: rigid        !! with its pose
    real(wp), intent(in) :: velocity(3)               !! of the centre [m/s]
    real(wp), intent(in) :: spin(3)                   !! [rad/s]
    type(obstacle_type), intent(inout) :: obstacle    !! its shape stays
    integer :: c

    obstacle%centre = rigid%pose%centre + rigid%pose%place
    do c = 1, 3
      obstacle%frame(:, c) = rigid%axes(:, c) + turned_by(rigid%pose%turn, rigid%axes(:, c))
    end do
    obstacle%velocity = velocity
    obstacle%spin = spin
  end subroutine place_obstacle

  !> Bring what is given to time `t`: displacements and velocities of components, and the angular
  !> velocity.
  subroutine guide_body(t, number, rigid, fault)
    real(wp), intent(in) :: t                       !! [s]
    integer, intent(in) :: number                   !! of the rigid body, for messages
    type(rigid_body_type), intent(inout) :: rigid   !! its pose changes
    type(condition_fault), allocatable, intent(inout) :: fault
      !! the first value that is not finite
    integer :: c

    do c = 1, rigid%pose%dim
      if (.not. rigid%free(c)) call course_at(rigid%place(c), t, rigid%pose%place(c), &
        & rigid%pose%velocity(c), number, 'displacement_'//xyz(c), fault)
    end do
    if (rigid%turns == turns_not) rigid%pose%momentum = 0.0_wp
    if (rigid%turns == turns_as_given) &
      & rigid%pose%momentum = momentum_of(rigid%pose, given_spin(rigid, t, number, fault))
  end subroutine guide_body

  !> The angular velocity that is given at time `t` [rad/s].
  function given_spin(rigid, t, number, fault) result(spin)
    type(rigid_body_type), intent(in) :: rigid
    real(wp), intent(in) :: t
    integer, intent(in) :: number
    type(condition_fault), allocatable, intent(inout) :: fault
    real(wp) :: spin(3), rate
    integer :: c

    do c = 1, 3
      call course_at(rigid%spin(c), t, spin(c), rate, number, 'spin_'//xyz(c), fault)
    end do
  end function given_spin

  !> The angular velocity at time `t` [rad/s].
  function spin_now(rigid, t) result(spin)
    type(rigid_body_type), intent(in) :: rigid   !! at this time
    real(wp), intent(in) :: t                    !! [s]
    real(wp) :: spin(3)
    type(condition_fault), allocatable :: ignored

    spin = 0.0_wp
    if (rigid%turns == turns_freely) spin = spin_of(rigid%pose)
    if (rigid%turns == turns_as_given) spin = given_spin(rigid, t, 1, ignored)
  end function spin_now

  !> Let contact and weight act for a time on what is free.
  pure subroutine kick_body(kick, rigid)
    real(wp), intent(in) :: kick                    !! [s]
    type(rigid_body_type), intent(inout) :: rigid   !! with force and torque of its pose

    associate (pose => rigid%pose)
      ! what is given in all components may have no mass
      if (any(rigid%free)) then
        where (rigid%free) pose%velocity = pose%velocity + kick*(pose%force/pose%mass &
          & + rigid%gravity)
      end if
      if (rigid%turns == turns_freely) pose%momentum = pose%momentum + kick*pose%torque
    end associate
  end subroutine kick_body

  !> Move on from `t` to `t` + `dt` with the velocities of the middle of the step, and the surface
  !> with the body.
  subroutine move_body(t, dt, number, rigid, obstacle, fault)
    real(wp), intent(in) :: t, dt                   !! [s]
    integer, intent(in) :: number                   !! of the rigid body, for messages
    type(rigid_body_type), intent(inout) :: rigid   !! after its kick
    type(obstacle_type), intent(inout) :: obstacle  !! its surface
    type(condition_fault), allocatable, intent(inout) :: fault
      !! the first value that is not finite
    real(wp) :: place(3), turn(4)

    place = rigid%pose%place
    turn = rigid%pose%turn
    if (rigid%turns == turns_as_given) then
      rigid%pose%momentum = 0.0_wp
      call drift(dt, rigid%pose)
      call turn_on(dt*given_spin(rigid, t + dt/2, number, fault), rigid%pose%turn)
    else
      call drift(dt, rigid%pose)
    end if
    call guide_body(t + dt, number, rigid, fault)
    obstacle%shift = rigid%pose%place - place
    obstacle%turn = rotation_between(turn, rigid%pose%turn)
    call place_obstacle(rigid, obstacle%shift/dt, obstacle%turn/dt, obstacle)
  end subroutine move_body

  !> Kinetic energy of the centre and of rotation [J].
  function kinetic_of(rigid, t) result(kinetic)
    type(rigid_body_type), intent(in) :: rigid   !! with the velocities of time `t`
    real(wp), intent(in) :: t                    !! [s]
    real(wp) :: kinetic(2)

    kinetic(1) = rigid%pose%mass/2*sum(rigid%pose%velocity**2)
    kinetic(2) = dot_product(spin_now(rigid, t), rigid%pose%momentum)/2
  end function kinetic_of

  !> Keep where a body and its surface are and how they move, or put them back.
  subroutine keep_body(archive, number, rigid, obstacle)
    class(archive_type), intent(inout) :: archive    !! a checkpoint that is written or read
    integer, intent(in) :: number                    !! of the rigid body
    type(rigid_body_type), intent(inout) :: rigid    !! set where the archive reads
    type(obstacle_type), intent(inout) :: obstacle   !! set where the archive reads
    real(wp), allocatable :: values(:)

    call keep_pose(archive, 'rigid body '//to_text(number), rigid%pose)
    values = [rigid%last_load, rigid%last_kinetic, merge(1.0_wp, 0.0_wp, rigid%accounted), &
      & obstacle%velocity, obstacle%spin, obstacle%shift, obstacle%turn]
    call archive%keep('account of rigid body '//to_text(number), values)
    rigid%last_load = values(1:6)
    rigid%last_kinetic = values(7:8)
    rigid%accounted = values(9) > 0.5_wp
    obstacle%shift = values(16:18)
    obstacle%turn = values(19:21)
    call place_obstacle(rigid, values(10:12), values(13:15), obstacle)
  end subroutine keep_body

end module pd_motion_rigid_body
